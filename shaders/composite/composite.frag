// SPDX-License-Identifier: GPL-3.0-or-later
// One sample of the picture, added to the film: layer 0's radiance over the background, or a debug view of one layer.

#include "common/bsdf.glsl"
#include "common/camera.glsl"
#include "common/hash.glsl"
#include "common/octahedral.glsl"
#include "common/shared_exponent.glsl"
#include "generated/CompositeUniforms.glsl"
#include "generated/outputs.glsl"
#include "common/environment.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
uniform sampler2DArray emission_layers;
uniform usampler2DArray object_index_layers;
uniform sampler2DArray motion_layers;
uniform sampler2DArray exit_view_depth_layers;
uniform sampler2DArray exit_normal_layers;
uniform sampler2DArray exit_base_color_layers;
uniform sampler2DArray radiance_layers;
uniform sampler2DArray diffuse_layers;
uniform sampler2DArray glossy_layers;
uniform sampler2DArray irradiance_layers;
uniform sampler2DArray origin_layers;

// Motion of this many pixels is shown with half of the greatest saturation.
const float MOTION_SCALE = 8.0;

/** View depth (m) as 0…1: half where it is 1 m, 1 at infinity. */
float depth_shade(float view_depth)
{
    return isinf(view_depth) ? 1.0 : view_depth / (1.0 + view_depth);
}

#if defined(DEBUG_GRID_CELLS) || defined(DEBUG_GRID_RADIANCE) || defined(DEBUG_MARCH_HITS) || defined(DEBUG_LIGHT_ORIGIN)
#define DEBUG_ORIGIN
#endif

#ifdef DEBUG_ORIGIN
/** What the indirect method left to be shown at a pixel; a texel may be for several. */
vec3 shown_origin(ivec2 pixel)
{
    ivec2 pixels_per_texel = ivec2(round(camera_resolution / vec2(textureSize(origin_layers, 0).xy)));
    return texelFetch(origin_layers, ivec3(pixel / pixels_per_texel, 0), 0).rgb;
}
#endif

#if defined(DEBUG_EXIT_NORMAL) || defined(DEBUG_EXIT_ALBEDO)
/** Whether a layer has an exit surface at a texel. */
bool has_exit(ivec3 texel)
{
    return !isinf(texelFetch(exit_view_depth_layers, texel, 0).r);
}
#endif

/** What a covered texel shows. */
vec3 shown_color(ivec3 texel, float view_depth)
{
#if defined(DIRECT) || defined(DEBUG_DIRECT)
    return texelFetch(radiance_layers, texel, 0).rgb;
#elif defined(DEBUG_DEPTH)
    return vec3(depth_shade(view_depth));
#elif defined(DEBUG_NORMAL)
    return 0.5 * decode_octahedral(texelFetch(normal_layers, texel, 0).rg) + 0.5;
#elif defined(DEBUG_ALBEDO)
    return texelFetch(base_color_layers, texel, 0).rgb;
#elif defined(DEBUG_METALLIC)
    return texelFetch(material_layers, texel, 0).rrr;
#elif defined(DEBUG_ROUGHNESS)
    return texelFetch(material_layers, texel, 0).ggg;
#elif defined(DEBUG_EMISSION)
    return decode_shared_exponent(texelFetch(emission_layers, texel, 0));
#elif defined(DEBUG_OBJECT_INDEX)
    uint object_index = texelFetch(object_index_layers, texel, 0).r;
    return vec3(hash_to_unit(uvec2(object_index, 0u)), hash_to_unit(uvec2(object_index, 1u)).x);
#elif defined(DEBUG_MOTION)
    // Red: to the right, green: up; grey: at rest. The direction stays readable however fast, and nothing is clipped.
    vec2 motion = texelFetch(motion_layers, texel, 0).rg;
    return vec3(0.5 + 0.5 * motion / (MOTION_SCALE + length(motion)), 0.5);
#elif defined(DEBUG_EXIT_DEPTH)
    return vec3(depth_shade(texelFetch(exit_view_depth_layers, texel, 0).r));
#elif defined(DEBUG_EXIT_NORMAL)
    return has_exit(texel) ? 0.5 * decode_octahedral(texelFetch(exit_normal_layers, texel, 0).rg) + 0.5 : vec3(0.0);
#elif defined(DEBUG_EXIT_ALBEDO)
    return has_exit(texel) ? texelFetch(exit_base_color_layers, texel, 0).rgb : vec3(0.0);
#elif defined(DEBUG_INDIRECT)
    return texelFetch(irradiance_layers, ivec3(texel.xy, 0), 0).rgb / PI;
#elif defined(DEBUG_ORIGIN)
    return shown_origin(texel.xy);
#else
    return vec3(0.0);
#endif
}

#ifdef SUN_DISC
/** Radiance, W/(sr·m²), of the sun's disc in a unit direction in world space, as SunDisc in scene/scene.py says. */
vec3 sun_disc_radiance(vec3 direction)
{
    // Of small arguments, asin is exact on all drivers: from the chord, and from the sine of the elevations' difference.
    float angle = 2.0 * asin(min(0.5 * distance(direction, sun_direction.xyz), 1.0));
    float elevation = asin(clamp(
        dot(direction, sun_zenith.xyz) * length(cross(sun_direction.xyz, sun_zenith.xyz))
            - length(cross(direction, sun_zenith.xyz)) * dot(sun_direction.xyz, sun_zenith.xyz),
        -1.0, 1.0));
    if (angle >= sun_direction.w || elevation <= sun_zenith.w)
        return vec3(0.0);
    float height = (elevation - sun_lowest.w) / max(sun_direction.w - sun_lowest.w, 1e-9);
    float limb = 1.0 - sun_highest.w * (1.0 - sqrt(1.0 - (angle / sun_direction.w) * (angle / sun_direction.w)));
    return mix(sun_lowest.rgb, sun_highest.rgb, height) * limb;
}
#endif

/** What the camera sees of the world through a pixel. */
vec3 background_radiance(vec2 pixel)
{
    if (world_seen == 0)
        return vec3(0.0);
    vec3 direction = -view_direction(pixel);
#ifdef SUN_DISC
    return environment_radiance(direction) + sun_disc_radiance(direction);
#else
    return environment_radiance(direction);
#endif
}

#if defined(FILM_DIFFUSE_COLOR) || defined(FILM_GLOSSY_COLOR) || defined(INDIRECT)
/** The surface of the nearest layer. */
Surface surface_of(ivec3 texel, vec2 pixel)
{
    vec4 base_color = texelFetch(base_color_layers, texel, 0);
    vec4 material = texelFetch(material_layers, texel, 0);
    vec3 normal = decode_octahedral(texelFetch(normal_layers, texel, 0).rg);
    float n_dot_v = clamp(dot(normal, view_direction(pixel)), 0.0, 1.0);
    return make_surface(base_color.rgb, base_color.a, material.r, material.g, material.b, n_dot_v);
}
#endif

#ifdef INDIRECT
/** Radiance that the nearest layer reflects diffusely of the irradiance that the indirect method found. */
vec3 indirect_radiance(ivec3 first, vec2 pixel)
{
    vec3 normal = decode_octahedral(texelFetch(normal_layers, first, 0).rg);
    float n_dot_v = clamp(dot(normal, view_direction(pixel)), 0.0, 1.0);
    vec3 albedo = diffuse_directional_albedo(surface_of(first, pixel), n_dot_v);
    return albedo * texelFetch(irradiance_layers, first, 0).rgb / PI;
}
#endif

void main()
{
    vec2 pixel = gl_FragCoord.xy + float(guard_band);
    ivec3 first = ivec3(pixel, 0);
#ifdef INDIRECT
    vec3 indirect = indirect_radiance(first, pixel);
#endif
#ifdef FILM_COMBINED
    ivec3 shown = ivec3(pixel, shown_layer);
    float view_depth = texelFetch(view_depth_layers, shown, 0).r;
    if (isinf(view_depth))
        out_combined = opaque != 0 ? vec4(background_radiance(pixel), 1.0) : vec4(0.0);
    else
        out_combined = vec4(shown_color(shown, view_depth), 1.0);
#ifdef ADD_INDIRECT
    if (!isinf(view_depth))
        out_combined.rgb += indirect;
#endif
#endif

    bool covered = !isinf(texelFetch(view_depth_layers, first, 0).r);
#ifdef FILM_NORMAL
    vec3 normal = decode_octahedral(texelFetch(normal_layers, first, 0).rg);
    out_normal = vec4(covered ? normal : vec3(0.0), 0.0);
#endif
#if defined(FILM_DIFFUSE_COLOR) || defined(FILM_GLOSSY_COLOR)
    Surface surface = surface_of(first, pixel);
#endif
#ifdef FILM_DIFFUSE_COLOR
    out_diffuse_color = vec4(covered ? surface.diffuse_albedo : vec3(0.0), 0.0);
#endif
#ifdef FILM_GLOSSY_COLOR
    out_glossy_color = vec4(covered ? surface.specular_albedo : vec3(0.0), 0.0);
#endif
#ifdef FILM_DIFFUSE_DIRECT
    out_diffuse_direct = vec4(0.0);
#ifdef SPLIT
    out_diffuse_direct = texelFetch(diffuse_layers, first, 0);
#endif
#endif
#ifdef FILM_GLOSSY_DIRECT
    out_glossy_direct = vec4(0.0);
#ifdef SPLIT
    out_glossy_direct = texelFetch(glossy_layers, first, 0);
#endif
#endif
#ifdef FILM_EMISSION
    out_emission = vec4(decode_shared_exponent(texelFetch(emission_layers, first, 0)), 0.0);
#endif
#ifdef FILM_ENVIRONMENT
    out_environment = vec4(covered ? vec3(0.0) : background_radiance(pixel), 0.0);
#endif
#ifdef FILM_DIFFUSE_INDIRECT
    out_diffuse_indirect = vec4(0.0);
#ifdef INDIRECT
    out_diffuse_indirect = vec4(covered ? indirect : vec3(0.0), 0.0);
#endif
#endif
}
