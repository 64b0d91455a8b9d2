// SPDX-License-Identifier: GPL-3.0-or-later
// The rays that tell which faces see which.

#include "common/basis.glsl"
#include "common/constants.glsl"
#include "common/hash.glsl"
#include "radiance_grid/face.glsl"

/**
 * A unit vector about a face's normal with density cosθ/π, another for each ray and face.
 *
 * `place`: what the table says of the face's place, not its number, which depends on what else there is.
 */
vec3 ray_direction(Face face, uvec2 place, int ray)
{
    const float GOLDEN = 0.6180339887498949;
    vec2 lattice = vec2((float(ray) + 0.5) / float(ray_count), float(ray) * GOLDEN);
    vec2 u = fract(lattice + hash_to_unit(place));
    vec3 tangent, bitangent;
    orthonormal_basis(face.normal, tangent, bitangent);
    float radius = sqrt(u.x), angle = 2.0 * PI * u.y;
    return normalize(radius * (cos(angle) * tangent + sin(angle) * bitangent) + sqrt(1.0 - u.x) * face.normal);
}
