// SPDX-License-Identifier: GPL-3.0-or-later
// Which pixel a gathered texel looks from, and in which directions. Uniforms: GATHER_UNIFORMS in render/gathering.py,
// which the including shader has in its block. Needs common/camera.glsl.

#include "common/basis.glsl"
#include "common/constants.glsl"

/** The pixel, of the whole guarded picture, whose irradiance a texel of the gathered target holds. */
ivec2 gathered_pixel(ivec2 texel)
{
    return min(texel * gather_divisor + ivec2(gather_offset), ivec2(camera_resolution) - 1);
}

/** How far along a Hilbert curve over 64 × 64 pixels a pixel is (Skilling 2004). */
uint hilbert_index(uvec2 pixel)
{
    uint index = 0u;
    uvec2 place = pixel & 63u;
    for (uint side = 32u; side > 0u; side >>= 1u) {
        uvec2 half_place = uvec2(greaterThan(place & side, uvec2(0u)));
        index += side * side * ((3u * half_place.x) ^ half_place.y);
        if (half_place.y == 0u) {
            if (half_place.x == 1u)
                place = 63u - place;
            place = place.yx;
        }
    }
    return index;
}

/**
 * A point in [0, 1)² for one of `rays` rays of a texel: low discrepancy among a texel's rays, among the texels of a
 * neighbourhood and among samples.
 *
 * A Fibonacci lattice over the rays, moved for every texel along Roberts' R2 sequence (2018, "The Unreasonable
 * Effectiveness of Quasirandom Sequences") in the order of a Hilbert curve.
 */
vec2 ray_random(ivec2 texel, int ray, int rays)
{
    const vec2 R2 = vec2(0.7548776662466927, 0.5698402909980532);
    const float GOLDEN = 0.6180339887498949;
    vec2 lattice = vec2((float(ray) + 0.5) / float(rays), fract(float(ray) * GOLDEN));
    return fract(lattice + fract(float(hilbert_index(uvec2(texel))) * R2) + gather_shift);
}

/** A unit vector about a unit normal with density cosθ/π, for a point of the unit square. */
vec3 cosine_direction(vec3 normal, vec2 u)
{
    vec3 tangent, bitangent;
    orthonormal_basis(normal, tangent, bitangent);
    float radius = sqrt(u.x), angle = 2.0 * PI * u.y;
    return normalize(radius * (cos(angle) * tangent + sin(angle) * bitangent) + sqrt(1.0 - u.x) * normal);
}
