// SPDX-License-Identifier: GPL-3.0-or-later
// Instanced triangles into camera-relative space: world axes, the camera's position as origin.

#include "generated/GBufferUniforms.glsl"

in vec3 in_position;
in vec3 in_normal;
#ifdef TEXTURE
in vec2 in_uv;
#endif
#ifdef ATTRIBUTE
in vec4 in_color;
#endif
in vec4 in_row_0; // rows of world-from-object
in vec4 in_row_1;
in vec4 in_row_2;
in vec3 in_translation_low; // what float32 loses of the fourth column
#ifdef WRITE_OBJECT_INDEX
in int in_object_index;
#endif

// Every layer must place its fragments alike, whichever variant draws them.
invariant gl_Position;

out float v_view_depth;
#ifdef WRITE_NORMAL
out vec3 v_position;
out vec3 v_normal;
flat out float v_handedness;
#endif
#ifdef TEXTURE
out vec2 v_uv;
#endif
#ifdef ATTRIBUTE
out vec3 v_color;
#endif
#ifdef WRITE_OBJECT_INDEX
flat out uint v_object_index;
#endif

void main()
{
    // Part by part: the high parts cancel exactly where object and camera are near each other.
    precise vec3 high = vec3(in_row_0.w, in_row_1.w, in_row_2.w) - camera_high.xyz;
    precise vec3 translation = high + (in_translation_low - camera_low.xyz);
    vec3 position = vec3(dot(in_row_0.xyz, in_position), dot(in_row_1.xyz, in_position),
                         dot(in_row_2.xyz, in_position)) + translation;
    gl_Position = clip_from_relative * vec4(position, 1.0);
    v_view_depth = dot(forward.xyz, position);
    gl_ClipDistance[0] = clip_end - v_view_depth;
#ifdef WRITE_NORMAL
    v_position = position;
    // The cofactor matrix carries normals; its sign, unlike the inverse transpose's, does not depend on mirroring.
    vec3 across = cross(in_row_1.xyz, in_row_2.xyz);
    v_handedness = dot(in_row_0.xyz, across) < 0.0 ? -1.0 : 1.0;
    v_normal = v_handedness * vec3(dot(across, in_normal),
                                   dot(cross(in_row_2.xyz, in_row_0.xyz), in_normal),
                                   dot(cross(in_row_0.xyz, in_row_1.xyz), in_normal));
#endif
#ifdef TEXTURE
    v_uv = in_uv;
#endif
#ifdef ATTRIBUTE
    v_color = in_color.rgb;
#endif
#ifdef WRITE_OBJECT_INDEX
    v_object_index = uint(max(in_object_index, 0));
#endif
}
