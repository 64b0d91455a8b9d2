// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of every pixel from the gathered texels around it that see the same surface.

#include "common/octahedral.glsl"
#include "filter/surfaces.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;
uniform sampler2DArray unfiltered;

layout(location = 0) out vec4 out_irradiance; // W/m², variance of its luminance

// Texels from a pixel in which another surface's light is looked for, where none of its own surface is known.
const int REACH = 4;

/**
 * Irradiance of the texel that sees what is nearest in depth; of those that are equally near in the picture.
 *
 * `around`: a texel near the pixel. Rings are searched outwards, and the first that sees anything is taken from.
 */
vec4 nearest_in_depth(ivec2 around, ivec2 last, float view_depth)
{
    vec4 nearest = vec4(0.0);
    float least = 1e38;
    int rings = REACH;
    for (int ring = 0; ring <= rings; ring++) {
        int side = 2 * ring + 1;
        for (int i = 0; i < side * side; i++) {
            ivec2 offset = ivec2(i % side, i / side) - ring, texel = around + offset;
            bool on_ring = max(abs(offset.x), abs(offset.y)) == ring;
            if (!on_ring || any(lessThan(texel, ivec2(0))) || any(greaterThan(texel, last)))
                continue;
            float other_depth = seen_by(texel).view_depth;
            float difference = abs(other_depth - view_depth);
            if (other_depth > 0.0 && difference < least) {
                nearest = texelFetch(unfiltered, ivec3(texel, 0), 0);
                least = difference;
                // One ring more, for diagonal neighbours are no farther than the next ones straight ahead.
                rings = min(rings, ring + 1);
            }
        }
    }
    return nearest;
}

void main()
{
    ivec3 pixel = ivec3(gl_FragCoord.xy, 0);
    float view_depth = texelFetch(view_depth_layers, pixel, 0).r;
    out_irradiance = vec4(0.0);
    if (isinf(view_depth))
        return;
    vec3 normal = decode_octahedral(texelFetch(normal_layers, pixel, 0).rg) * mat3(world_from_camera);
    Seen seen = Seen(normal, view_depth, vec2(pixel.xy));
    SurfacePlane plane = plane_of(seen);
    float tolerance = tolerance_at(view_depth);

    ivec2 last = textureSize(unfiltered, 0).xy - 1;
    vec2 place = clamp((vec2(pixel.xy) - gather_offset) / float(gather_divisor), vec2(0.0), vec2(last));
    ivec2 corner = ivec2(place);
    vec2 beyond = place - vec2(corner);
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int i = 0; i < 4; i++) {
        ivec2 offset = ivec2(i & 1, i >> 1), texel = min(corner + offset, last);
        vec2 share = mix(1.0 - beyond, beyond, vec2(offset));
        float weight = share.x * share.y * same_surface(seen, plane, tolerance, seen_by(texel));
        vec4 value = texelFetch(unfiltered, ivec3(texel, 0), 0);
        if (weight > 0.0) { // a texel without weight may hold anything
            sum += weight * value;
            total += weight;
        }
    }
    if (total > 0.0)
        out_irradiance = sum / total;
    else
        out_irradiance = nearest_in_depth(ivec2(place + 0.5), last, view_depth);
}
