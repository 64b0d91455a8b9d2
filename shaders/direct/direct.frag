// SPDX-License-Identifier: GPL-3.0-or-later
// Outgoing radiance of one layer: what lamps, emissive surfaces and the world send to it past what is in between, and
// what it emits itself.

#include "common/camera.glsl"
#include "common/direct_light.glsl"
#include "common/hash.glsl"
#include "common/octahedral.glsl"
#include "common/shared_exponent.glsl"
#include "direct/outputs.glsl"

uniform sampler2DArray view_depth_layers;
#if defined(LIGHTS) || defined(WORLD)
uniform sampler2DArray normal_layers;
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
#endif
#ifdef EMISSION
uniform sampler2DArray emission_layers;
#endif

// Surfaces are where they are drawn to this part of a pixel: vertices are snapped to such a grid.
const float SURFACE_PRECISION = 1.0 / 256.0;

void main()
{
    ivec3 texel = ivec3(gl_FragCoord.xy, layer);
    float view_depth = texelFetch(view_depth_layers, texel, 0).r;
    Reflected reflected = Reflected(vec3(0.0), vec3(0.0));
    vec3 emitted = vec3(0.0);
    bool covered = !isinf(view_depth);
    if (covered) {
#ifdef EMISSION
        emitted = decode_shared_exponent(texelFetch(emission_layers, texel, 0));
#endif
#if defined(LIGHTS) || defined(WORLD)
        Shading shading;
        shading.normal = decode_octahedral(texelFetch(normal_layers, texel, 0).rg);
        vec4 base_color = texelFetch(base_color_layers, texel, 0);
        vec4 material = texelFetch(material_layers, texel, 0);
        shading.view = view_direction(gl_FragCoord.xy);
        float n_dot_v = clamp(dot(shading.normal, shading.view), 0.0, 1.0);
        shading.surface =
            make_surface(base_color.rgb, base_color.a, material.r, material.g, material.b, n_dot_v);
        shading.world_surface = make_surface(base_color.rgb, base_color.a, material.r, world_roughness(material.g),
                                             material.b, n_dot_v);
        shading.position = relative_position(gl_FragCoord.xy, view_depth);
        shading.precision_along_view = SURFACE_PRECISION * pixel_width(view_depth) / max(n_dot_v, 0.02);
        shading.link_group = int(255.0 * material.a + 0.5);
        // Counted from the picture's corner, so that a guard band does not change the picture.
        uvec2 pixel = uvec2(ivec2(gl_FragCoord.xy) - guard_band);
        shading.random = fract(hash_to_unit(pixel) + pixel_shift);
        reflected = lit(shading);
#endif
    }
    write_radiance(emitted, reflected.diffuse, reflected.glossy, covered ? 1.0 : 0.0);
}
