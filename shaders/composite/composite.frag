// SPDX-License-Identifier: GPL-3.0-or-later
// One sample of the picture, added to the film: layer 0's radiance over the background, or a debug view of one layer.

#include "common/bsdf.glsl"
#include "common/camera.glsl"
#include "common/hash.glsl"
#include "common/octahedral.glsl"
#include "generated/CompositeUniforms.glsl"
#include "generated/outputs.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
uniform sampler2DArray emission_layers;
uniform usampler2DArray object_index_layers;
uniform sampler2DArray radiance_layers;

/** What a covered texel shows. */
vec3 shown_color(ivec3 texel, float view_depth)
{
#if defined(DIRECT) || defined(DEBUG_DIRECT)
    return texelFetch(radiance_layers, texel, 0).rgb;
#elif defined(DEBUG_DEPTH)
    return vec3(view_depth / (1.0 + view_depth));
#elif defined(DEBUG_NORMAL)
    return 0.5 * decode_octahedral(texelFetch(normal_layers, texel, 0).rg) + 0.5;
#elif defined(DEBUG_ALBEDO)
    return texelFetch(base_color_layers, texel, 0).rgb;
#elif defined(DEBUG_METALLIC)
    return texelFetch(material_layers, texel, 0).rrr;
#elif defined(DEBUG_ROUGHNESS)
    return texelFetch(material_layers, texel, 0).ggg;
#elif defined(DEBUG_EMISSION)
    return texelFetch(emission_layers, texel, 0).rgb;
#elif defined(DEBUG_OBJECT_INDEX)
    uint object_index = texelFetch(object_index_layers, texel, 0).r;
    return vec3(hash_to_unit(uvec2(object_index, 0u)), hash_to_unit(uvec2(object_index, 1u)).x);
#else
    return vec3(0.0);
#endif
}

void main()
{
    ivec3 shown = ivec3(gl_FragCoord.xy, shown_layer);
    float shown_depth = texelFetch(view_depth_layers, shown, 0).r;
    out_combined = isinf(shown_depth) ? background : vec4(shown_color(shown, shown_depth), 1.0);

#if defined(FILM_NORMAL) || defined(FILM_DIFFUSE_COLOR)
    ivec3 first = ivec3(gl_FragCoord.xy, 0);
    bool covered = !isinf(texelFetch(view_depth_layers, first, 0).r);
    vec3 normal = decode_octahedral(texelFetch(normal_layers, first, 0).rg);
#endif
#ifdef FILM_NORMAL
    out_normal = vec4(covered ? normal : vec3(0.0), 0.0);
#endif
#ifdef FILM_DIFFUSE_COLOR
    vec4 base_color = texelFetch(base_color_layers, first, 0);
    vec2 material = texelFetch(material_layers, first, 0).rg;
    float n_dot_v = clamp(dot(normal, view_direction(gl_FragCoord.xy)), 0.0, 1.0);
    Surface surface = make_surface(base_color.rgb, base_color.a, material.r, material.g, n_dot_v);
    out_diffuse_color = vec4(covered ? surface.diffuse_albedo : vec3(0.0), 0.0);
#endif
}
