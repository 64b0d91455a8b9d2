// SPDX-License-Identifier: GPL-3.0-or-later
// Casters as a light sees them.

#include "gbuffer/pose.glsl"
#include "generated/ShadowMapsUniforms.glsl"

in vec3 in_position;
#ifdef ALPHA_TEST
in vec2 in_uv;

out vec2 uv;
#endif
out float view_depth;

void main()
{
    Pose pose = Pose(in_row_0, in_row_1, in_row_2, in_translation_low);
    vec3 relative = relative_to(light_high.xyz, light_low.xyz, pose, in_position);
    view_depth = dot(forward.xyz, relative);
    gl_Position = clip_from_relative * vec4(relative, 1.0);
#ifdef ALPHA_TEST
    uv = in_uv;
#endif
}
