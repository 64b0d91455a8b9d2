// SPDX-License-Identifier: GPL-3.0-or-later
// Outgoing radiance of one layer: what its triangles' vertices reflect, blended, by the layer's own colours.

#include "common/bsdf.glsl"
#include "common/shared_exponent.glsl"
#include "direct/outputs.glsl"
#include "gbuffer/reversed_depth.glsl"
#include "generated/GBufferUniforms.glsl"
#include "generated/MaterialUniforms.glsl"

uniform sampler2DArray view_depth_layers;
#if defined(LIGHTS) || defined(WORLD)
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
#endif
#ifdef EMISSION
uniform sampler2DArray emission_layers;
#endif
#ifdef ALPHA_TEST
uniform sampler2D base_color_texture;

in vec2 uv;
#endif

in float view_depth;
#if defined(LIGHTS) || defined(WORLD)
in vec3 front_diffuse;
in vec3 back_diffuse;
#ifdef SPECULAR
in vec3 front_glossy;
in vec3 back_glossy;
#endif
#endif

/**
 * By how much (m) two programs may differ in the view depth of the same fragment: they round differently, and the
 * rasteriser goes from the picture's corner to the fragment along the depth's slope. Takes derivatives.
 */
float rounding()
{
    vec2 slope = abs(vec2(dFdx(view_depth), dFdy(view_depth)));
    return 4.0 * FLOAT_EPSILON * (view_depth + dot(slope, resolution));
}

void main()
{
    ivec3 texel = ivec3(gl_FragCoord.xy, first_layer);
    float kept = texelFetch(view_depth_layers, texel, 0).r;
    float tolerance = rounding();
    if (isinf(kept) || !(abs(view_depth - kept) <= tolerance))
        discard;
#ifdef ALPHA_TEST
    if (material_emission.a * textureLod(base_color_texture, uv, 0.0).a < alpha_threshold)
        discard;
#endif
#ifdef FRAGMENT_DEPTH
    gl_FragDepth = reversed_depth(view_depth);
#endif
    vec3 emitted = vec3(0.0), diffuse = vec3(0.0), glossy = vec3(0.0);
#ifdef EMISSION
    emitted = decode_shared_exponent(texelFetch(emission_layers, texel, 0));
#endif
#if defined(LIGHTS) || defined(WORLD)
    vec4 base_color = texelFetch(base_color_layers, texel, 0);
    vec4 material = texelFetch(material_layers, texel, 0);
    Surface surface = make_surface(base_color.rgb, base_color.a, material.r, material.g, material.b, 1.0);
    // Blends of nothing may round to less.
    diffuse = surface.diffuse_albedo * max(gl_FrontFacing ? front_diffuse : back_diffuse, 0.0);
#ifdef SPECULAR
    glossy = surface.specular_f0 * max(gl_FrontFacing ? front_glossy : back_glossy, 0.0);
#endif
#endif
    write_radiance(emitted, diffuse, glossy, 1.0);
}
