// SPDX-License-Identifier: GPL-3.0-or-later
// Layers of the deep G-buffer. Layer k keeps the nearest fragment with z > Z(k-1) + Δz, z the linear view depth, and
// Z(k-1) what an oracle says of the layer before (Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination
// Approximation"). With EXIT, what is kept is the first back face behind each layer.

#include "common/constants.glsl"
#include "common/finite.glsl"
#include "common/octahedral.glsl"
#include "common/shared_exponent.glsl"
#include "gbuffer/reversed_depth.glsl"
#include "gbuffer/surface.glsl"
#include "generated/GBufferUniforms.glsl"
#include "generated/MaterialUniforms.glsl"
#include "generated/outputs.glsl"

#ifdef TEXTURE
uniform sampler2D base_color_texture;
#endif
#if defined(ORACLE) || defined(EXIT)
uniform sampler2DArray oracle; // view depth per layer; EXIT: of the finished layers
#endif

in Surface
{
    SURFACE
} surface;

#if defined(WRITE_NORMAL) || defined(EXIT)
/** Whether the triangle's front, by its winding before any mirroring, faces the viewer. */
bool is_front()
{
    return gl_FrontFacing == (surface.handedness * image_handedness > 0.0);
}
#endif

#ifdef PREVIOUS
/** Pixels (x right, y up) moved since the previous frame; 0 where the surface was behind the camera. */
vec2 motion_vector()
{
    if (!(surface.previous.z > 0.0))
        return vec2(0.0);
    // Now and then in one vector operation, which rounds both alike: what did not move gives exactly 0.
    vec4 points = vec4(surface.clip.xy, surface.previous.xy) / vec4(surface.clip.zz, surface.previous.zz);
    return 0.5 * resolution * (points.xy - points.zw);
}
#endif

#ifdef ORACLE
/**
 * Whether a view depth is within the minimum separation behind the previous layer.
 *
 * `slope`: how much the depth may differ because the oracle was sampled elsewhere. Variants also round differently,
 * by a few units in the last place; without both allowances a surface would be its own next layer.
 */
bool too_near(ivec2 pixel, float view_depth, float slope)
{
    float nearer = texelFetch(oracle, ivec3(pixel, max(surface.layer - oracle_layer_offset, 0)), 0).r;
    float guard = 4.0 * FLOAT_EPSILON * nearer + slope;
    return !(view_depth > nearer + (minimum_separation + relative_separation * nearer) + guard);
}

// Pixels. Farther than this from where the oracle was sampled, a slope says little: off the picture, without guard band.
const float LARGEST_OFFSET = 1.5;

#if defined(DRIFT) || defined(REPROJECT)
/** Change of a view depth per pixel, x and y; in perspective its inverse is what is linear on the screen. */
vec2 depth_gradient(float depth)
{
    if (orthographic != 0)
        return vec2(dFdx(depth), dFdy(depth));
    float inverse_depth = 1.0 / depth;
    return vec2(dFdx(inverse_depth), dFdy(inverse_depth)) * -(depth * depth);
}
#endif

/** Whether this fragment is, by what the oracle knows. Derivatives: call where all fragments of a quad do. */
bool too_near_previous_layer()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float view_depth = surface.view_depth;
#if defined(DRIFT) || defined(REPROJECT)
    vec2 gradient = depth_gradient(surface.view_depth);
    vec2 offset = vec2(oracle_drift);
#endif
#ifdef REPROJECT
    vec2 origin = gl_FragCoord.xy - motion_vector();
    // From per pixel of now to per pixel of then: a surface may have been wider or narrower on the screen.
    vec2 previous_gradient =
        inverse(transpose(mat2(dFdx(origin), dFdy(origin)))) * depth_gradient(surface.previous.w);
    // Off the screen the nearest pixel of its edge is asked; behind the camera nothing was seen, and the same pixel
    // must do.
    if (surface.previous.w >= clip_start)
    {
        pixel = ivec2(clamp(origin, vec2(0.0), resolution - 0.5));
        offset = min(abs(origin - (vec2(pixel) + 0.5)), LARGEST_OFFSET);
        view_depth = surface.previous.w;
        gradient = previous_gradient;
    }
#endif
#if defined(DRIFT) || defined(REPROJECT)
    return too_near(pixel, view_depth, dot(abs(gradient), offset + oracle_snapping));
#else
    return too_near(pixel, view_depth, 0.0);
#endif
}
#endif

#ifdef EXIT
/** Whether this fragment is a back face behind the finished layer. */
bool is_exit()
{
    float entry = texelFetch(oracle, ivec3(gl_FragCoord.xy, surface.layer), 0).r;
    return !is_front() && surface.view_depth > entry + 4.0 * FLOAT_EPSILON * entry;
}
#endif

#ifdef WRITE_NORMAL
/** Unit world-space shading normal on the viewer's side of a triangle, whose own normal is `geometric`. */
vec3 facing_normal(vec3 geometric)
{
    float squared = dot(surface.normal, surface.normal);
    if (squared > 0.0)
        return surface.normal * (is_front() ? 1.0 : -1.0) * inversesqrt(squared);
    // No usable normal: the triangle's own, which derivatives of a visible surface turn towards the viewer.
    float area = length(geometric);
    return area > 0.0 ? geometric / area : -forward.xyz;
}
#endif

void main()
{
    // Derivatives are taken before any fragment of a quad is discarded; what needs none can wait.
#ifdef WRITE_NORMAL
    vec3 geometric = image_handedness * cross(dFdx(surface.position), dFdy(surface.position));
#endif
#ifdef TEXTURE
    float lod = textureQueryLod(base_color_texture, surface.uv).y + texture_lod_bias;
#endif
#ifdef ORACLE
    bool hidden = too_near_previous_layer();
    if (hidden && surface.layer > 0 && surface.layer != look_ahead_layer)
        discard;
#endif
#ifdef ALPHA_TEST
    // Level 0: averaging alpha would make distant foliage vanish.
    if (material_emission.a * textureLod(base_color_texture, surface.uv, 0.0).a < alpha_threshold)
        discard;
#endif
#ifdef EXIT
    if (!is_exit())
        discard;
#endif
#ifdef FRAGMENT_DEPTH
    gl_FragDepth = reversed_depth(surface.view_depth);
#endif
    out_view_depth = surface.view_depth;
#ifdef WRITE_NORMAL
    out_normal = encode_octahedral(facing_normal(geometric));
#endif
#ifdef WRITE_BASE_COLOR
    vec3 base_color = material_base_color.rgb;
#ifdef TEXTURE
    base_color *= textureLod(base_color_texture, surface.uv, lod).rgb;
#endif
#ifdef ATTRIBUTE
    base_color *= surface.color;
#endif
    out_base_color = vec4(clamp(base_color, 0.0, 65504.0), material_base_color.a);
#endif
#ifdef WRITE_MATERIAL
    out_material = vec4(material_surface.xyz, float(surface.link_group) / 255.0);
#endif
#ifdef WRITE_EMISSION
    out_emission = encode_shared_exponent(finite_radiance(material_emission.rgb));
#endif
#ifdef WRITE_OBJECT_INDEX
    out_object_index = surface.object_index;
#endif
#ifdef WRITE_MOTION
    out_motion = clamp(motion_vector(), -65504.0, 65504.0);
#endif
}
