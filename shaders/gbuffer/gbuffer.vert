// SPDX-License-Identifier: GPL-3.0-or-later
// Instanced triangles into camera-relative space: world axes, the camera's position as origin.

#ifdef VERTEX_LAYER
#if defined(GL_ARB_shader_viewport_layer_array)
#extension GL_ARB_shader_viewport_layer_array : require
#elif defined(GL_AMD_vertex_shader_layer)
#extension GL_AMD_vertex_shader_layer : require
#else
#extension GL_NV_viewport_array2 : require
#endif
#endif

#include "gbuffer/pose.glsl"
#include "gbuffer/surface.glsl"
#include "generated/GBufferUniforms.glsl"

in vec3 in_position;
in vec3 in_normal;
#ifdef TEXTURE
in vec2 in_uv;
#endif
#ifdef ATTRIBUTE
in vec4 in_color;
#endif
#if defined(WRITE_OBJECT_INDEX) || defined(WRITE_MATERIAL)
in int in_indices; // pass index; link group from bit 16 on
#endif
#ifdef PREVIOUS_POSE
in vec3 in_previous_position;
uniform sampler2D previous_poses;
#endif
#ifdef NEXT_POSE
in vec3 in_next_position;
uniform sampler2D next_poses;
#endif

// Every layer must place its fragments alike, whichever variant draws them.
invariant gl_Position;

out Surface
{
    SURFACE
} surface;
#if defined(LOOK_AHEAD) && defined(GEOMETRY_LAYERS)
out Ahead
{
    vec4 position;
    float view_depth;
} ahead;
#endif

#if defined(PREVIOUS_POSE) || defined(NEXT_POSE)
/** The pose of an instance from a texture with four texels each (`geometry.PoseTexture`). */
Pose fetch_pose(sampler2D poses, int instance)
{
    int per_row = textureSize(poses, 0).x / 4;
    ivec2 first = ivec2(4 * (instance % per_row), instance / per_row);
    return Pose(texelFetch(poses, first, 0), texelFetch(poses, first + ivec2(1, 0), 0),
                texelFetch(poses, first + ivec2(2, 0), 0), texelFetch(poses, first + ivec2(3, 0), 0).xyz);
}
#endif

void main()
{
    Pose pose = Pose(in_row_0, in_row_1, in_row_2, in_translation_low);
    vec3 relative = relative_to(camera_high.xyz, camera_low.xyz, pose, in_position);
    precise vec4 clip = clip_from_relative * vec4(relative, 1.0);
    precise float view_depth = dot(forward.xyz, relative);
#ifdef VERTEX_LAYER
    int instance = gl_InstanceID / layer_count;
    int layer = gl_InstanceID % layer_count;
#else
    int instance = gl_InstanceID;
    int layer = 0;
#endif
#ifdef PREVIOUS
#ifdef PREVIOUS_POSE
    Pose previous_pose = fetch_pose(previous_poses, instance);
    vec3 previous_position = in_previous_position;
#else
    Pose previous_pose = pose;
    vec3 previous_position = in_position;
#endif
    // The very same steps as above: where nothing moved, the results are equal to the last bit.
    vec3 previous_relative =
        relative_to(previous_camera_high.xyz, previous_camera_low.xyz, previous_pose, previous_position);
    precise vec4 previous_clip = previous_clip_from_relative * vec4(previous_relative, 1.0);
    precise float previous_view_depth = dot(previous_forward.xyz, previous_relative);
    surface.clip = clip.xyw;
    surface.previous = vec4(previous_clip.xyw, previous_view_depth);
#endif
#ifdef LOOK_AHEAD
#ifdef NEXT_POSE
    Pose next_pose = fetch_pose(next_poses, instance);
    vec3 next_position = in_next_position;
#else
    Pose next_pose = pose;
    vec3 next_position = in_position;
#endif
    vec3 next_relative = relative_to(next_camera_high.xyz, next_camera_low.xyz, next_pose, next_position);
    precise vec4 next_clip = next_clip_from_relative * vec4(next_relative, 1.0);
    precise float next_view_depth = dot(next_forward.xyz, next_relative);
#ifdef GEOMETRY_LAYERS
    ahead.position = next_clip;
    ahead.view_depth = next_view_depth;
#else
    if (layer == look_ahead_layer)
    {
        clip = next_clip;
        view_depth = next_view_depth;
    }
#endif
#endif
    gl_Position = clip;
    gl_ClipDistance[0] = clip_end - view_depth;
    surface.view_depth = view_depth;
    surface.layer = first_layer + layer;
#ifdef VERTEX_LAYER
    gl_Layer = layer;
#endif
#if defined(WRITE_NORMAL) || defined(EXIT)
    surface.handedness = handedness(pose);
#endif
#ifdef WRITE_NORMAL
    surface.position = relative;
    surface.normal = world_normal(pose, in_normal);
#endif
#ifdef TEXTURE
    surface.uv = in_uv;
#endif
#ifdef ATTRIBUTE
    surface.color = in_color.rgb;
#endif
#ifdef WRITE_OBJECT_INDEX
    surface.object_index = uint(in_indices & 0xFFFF);
#endif
#ifdef WRITE_MATERIAL
    surface.link_group = in_indices >> 16;
#endif
}
