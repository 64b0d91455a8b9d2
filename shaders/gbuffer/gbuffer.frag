// SPDX-License-Identifier: GPL-3.0-or-later
// One layer of the deep G-buffer. Layer k keeps the nearest fragment with z > Z(k-1) + Δz, z the linear view depth
// (Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination Approximation", two-pass generation).

#include "common/constants.glsl"
#include "common/finite.glsl"
#include "common/octahedral.glsl"
#include "generated/GBufferUniforms.glsl"
#include "generated/MaterialUniforms.glsl"
#include "generated/outputs.glsl"

#ifdef TEXTURE
uniform sampler2D base_color_texture;
#endif
#ifdef PEEL
uniform sampler2DArray oracle; // view depth of the layer before
#endif

in float v_view_depth;
#ifdef WRITE_NORMAL
in vec3 v_position;
in vec3 v_normal;
flat in float v_handedness;
#endif
#ifdef TEXTURE
in vec2 v_uv;
#endif
#ifdef ATTRIBUTE
in vec3 v_color;
#endif
#ifdef WRITE_OBJECT_INDEX
flat in uint v_object_index;
#endif

#ifdef PEEL
/** Whether the fragment lies within the minimum separation behind the previous layer. */
bool too_near_previous_layer()
{
    float previous = texelFetch(oracle, ivec3(gl_FragCoord.xy, 0), 0).r;
    // The last term keeps a surface from peeling itself where variants round differently.
    return !(v_view_depth > previous + minimum_separation + 4.0 * FLOAT_EPSILON * previous);
}
#endif

#ifdef WRITE_NORMAL
/** Unit world-space shading normal on the viewer's side of the triangle. */
vec3 facing_normal()
{
    vec3 geometric = image_handedness * cross(dFdx(v_position), dFdy(v_position));
    bool front = gl_FrontFacing == (v_handedness * image_handedness > 0.0);
    float squared = dot(v_normal, v_normal);
    if (squared > 0.0)
        return v_normal * (front ? 1.0 : -1.0) * inversesqrt(squared);
    // No usable normal: the triangle's own, which derivatives of a visible surface turn towards the viewer.
    float area = length(geometric);
    return area > 0.0 ? geometric / area : -forward.xyz;
}
#endif

#ifdef FRAGMENT_DEPTH
/** Depth 1 at the near plane, falling to 0: what a 0…1 clip space stores without this (`Camera.projection`). */
float reversed_depth()
{
    return orthographic != 0 ? (clip_end - v_view_depth) / (clip_end - clip_start) : clip_start / v_view_depth;
}
#endif

void main()
{
#ifdef WRITE_NORMAL
    vec3 normal = facing_normal();
#endif
#ifdef TEXTURE
    vec4 texel = texture(base_color_texture, v_uv, texture_lod_bias);
#endif
#ifdef ALPHA_TEST
    // Level 0: averaging alpha would make distant foliage vanish.
    if (material_emission.a * textureLod(base_color_texture, v_uv, 0.0).a < alpha_threshold)
        discard;
#endif
#ifdef PEEL
    if (layer > 0 && too_near_previous_layer())
        discard;
#endif
#ifdef FRAGMENT_DEPTH
    gl_FragDepth = reversed_depth();
#endif
    out_view_depth = v_view_depth;
#ifdef PEEL
    out_oracle = v_view_depth;
#endif
#ifdef WRITE_NORMAL
    out_normal = encode_octahedral(normal);
#endif
#ifdef WRITE_BASE_COLOR
    vec3 base_color = material_base_color.rgb;
#ifdef TEXTURE
    base_color *= texel.rgb;
#endif
#ifdef ATTRIBUTE
    base_color *= v_color;
#endif
    out_base_color = vec4(clamp(base_color, 0.0, 65504.0), material_base_color.a);
#endif
#ifdef WRITE_MATERIAL
    out_material = material_surface.xy;
#endif
#ifdef WRITE_EMISSION
    out_emission = vec4(finite_radiance(material_emission.rgb), 1.0);
#endif
#ifdef WRITE_OBJECT_INDEX
    out_object_index = v_object_index;
#endif
}
