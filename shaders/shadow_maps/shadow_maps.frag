// SPDX-License-Identifier: GPL-3.0-or-later
// The caster nearest to the light as a plane per texel: how near it is at the texel's centre, and how that changes.
//
// Nearness is 1/z in perspective maps and z_end − z in orthographic ones: either is linear on the map for a plane, so that
// a receiver can be compared with its caster's plane at its own place, not at the texel's. A surface then never shadows
// itself, however it is tilted, and needs no bias that would detach shadows.

#include "common/caster_plane.glsl"
#include "generated/MaterialUniforms.glsl"
#include "generated/ShadowMapsUniforms.glsl"

#ifdef ALPHA_TEST
uniform sampler2D base_color_texture;

in vec2 uv;
#endif
in float view_depth;

layout(location = 0) out uvec2 out_plane; // bits of the nearness; slopes along x and y

void main()
{
    float nearness = orthographic != 0 ? clip_end - view_depth : gl_FragCoord.w;
    vec2 gradient = vec2(dFdx(nearness), dFdy(nearness));
#ifdef ALPHA_TEST
    if (material_emission.a * textureLod(base_color_texture, uv, 0.0).a < alpha_threshold)
        discard;
#endif
#ifdef FRAGMENT_DEPTH
    gl_FragDepth = orthographic != 0 ? nearness / clip_end : clip_start * nearness;
#endif
    vec2 slope = gradient / slope_unit(orthographic != 0, nearness, texel);
    out_plane = uvec2(floatBitsToUint(nearness), encode_slope(slope));
}
