// SPDX-License-Identifier: GPL-3.0-or-later
// Outgoing radiance of one layer: light from lamps (unshadowed) and the constant world, plus emission.

#include "common/bsdf.glsl"
#include "common/camera.glsl"
#include "common/finite.glsl"
#include "common/hash.glsl"
#include "common/lights.glsl"
#include "common/octahedral.glsl"
#include "common/shared_exponent.glsl"
#include "generated/DirectUniforms.glsl"

#if defined(SUN_LIGHTS) || defined(AREA_LIGHTS) || defined(SPHERE_LIGHTS) || defined(DISK_LIGHTS)
#define LIGHTS
#endif

uniform sampler2DArray view_depth_layers;
#if defined(LIGHTS) || defined(WORLD)
uniform sampler2DArray normal_layers;
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
#endif
#ifdef EMISSION
uniform sampler2DArray emission_layers;
#endif

layout(location = 0) out vec4 out_radiance;

#ifdef LIGHTS
/** Radiance towards the viewer that all lights cause. */
vec3 lit_radiance(Surface surface, vec3 position, vec3 normal, vec3 view)
{
#ifdef SPECULAR
    bool glossy = any(greaterThan(surface.specular_f0, vec3(0.0)));
    // Highlights take another light sample in every pixel: shared ones would show as separate dots on glossy surfaces.
    // Counted from the picture's corner, so that a guard band does not change the picture.
    vec2 specular_sample = fract(light_sample + hash_to_unit(uvec2(ivec2(gl_FragCoord.xy) - guard_band)));
#endif
    vec3 radiance = vec3(0.0);
    for (int index = 0; index < light_count; ++index) {
        Light light = fetch_light(index);
        LightSample incident = sample_light(light, position, light_sample);
        float cosine = max(dot(normal, incident.direction), 0.0);
        radiance += surface.diffuse_albedo / PI * incident.weight * (cosine * light.diffuse_factor);
#ifdef SPECULAR
        if (!glossy)
            continue;
        if (is_extended(light))
            incident = sample_light(light, position, specular_sample);
        radiance += specular_brdf_cosine(surface, normal, view, incident.direction) * incident.weight
                    * light.specular_factor;
#endif
    }
    return radiance;
}
#endif

void main()
{
    ivec3 texel = ivec3(gl_FragCoord.xy, layer);
    float view_depth = texelFetch(view_depth_layers, texel, 0).r;
    if (isinf(view_depth)) {
        out_radiance = vec4(0.0);
        return;
    }
    vec3 radiance = vec3(0.0);
#ifdef EMISSION
    radiance += decode_shared_exponent(texelFetch(emission_layers, texel, 0));
#endif
#if defined(LIGHTS) || defined(WORLD)
    vec3 normal = decode_octahedral(texelFetch(normal_layers, texel, 0).rg);
    vec4 base_color = texelFetch(base_color_layers, texel, 0);
    vec2 material = texelFetch(material_layers, texel, 0).rg;
    vec3 view = view_direction(gl_FragCoord.xy);
    float n_dot_v = clamp(dot(normal, view), 0.0, 1.0);
    Surface surface = make_surface(base_color.rgb, base_color.a, material.r, material.g, n_dot_v);
#endif
#ifdef LIGHTS
    radiance += lit_radiance(surface, relative_position(gl_FragCoord.xy, view_depth), normal, view);
#endif
#ifdef WORLD
    radiance += world_radiance.rgb * (surface.diffuse_albedo + surface.specular_albedo);
#endif
    out_radiance = vec4(finite_radiance(radiance), 1.0);
}
