// SPDX-License-Identifier: GPL-3.0-or-later
// What vertices reflect, each as if it were white and a perfect mirror: Gouraud 1971, "Continuous Shading of Curved
// Surfaces". Both sides are lit, for whether a triangle shows its front is not known here.

#include "common/direct_light.glsl"
#include "common/finite.glsl"
#include "gbuffer/pose.glsl"
#include "generated/GBufferUniforms.glsl"
#include "generated/MaterialUniforms.glsl"

in vec3 in_position;
in vec3 in_normal;
#ifdef ALPHA_TEST
in vec2 in_uv;

out vec2 uv;
#endif
#ifdef LINKING
in int in_indices; // pass index; link group from bit 16 on
#endif

// Fragments must be where the G-buffer has them.
invariant gl_Position;

out float view_depth;
#if defined(LIGHTS) || defined(WORLD)
out vec3 front_diffuse; // radiance over the diffuse albedo; front: of triangles that OpenGL calls so
out vec3 back_diffuse;
#ifdef SPECULAR
out vec3 front_glossy;  // radiance over F0
out vec3 back_glossy;
#endif

/** What is lit here, towards `view`, on the side of a unit normal. */
Shading vertex_shading(vec3 position, vec3 normal, vec3 view)
{
    Shading shading;
    shading.surface = make_surface(vec3(1.0), 1.0, 1.0, material_surface.y, 0.0, 1.0);
    shading.surface.diffuse_albedo = vec3(1.0);
    shading.world_surface = make_surface(vec3(1.0), 1.0, 1.0, world_roughness(material_surface.y), 0.0, 1.0);
    shading.position = position;
    shading.normal = normal;
    shading.view = view;
    shading.precision_along_view = 0.0;
#ifdef LINKING
    shading.link_group = in_indices >> 16;
#else
    shading.link_group = 0;
#endif
    shading.random = pixel_shift; // the same for all vertices: some share a place
    return shading;
}
#endif

void main()
{
    Pose pose = Pose(in_row_0, in_row_1, in_row_2, in_translation_low);
    vec3 relative = relative_to(camera_high.xyz, camera_low.xyz, pose, in_position);
    precise vec4 clip = clip_from_relative * vec4(relative, 1.0);
    precise float depth = dot(forward.xyz, relative);
    gl_Position = clip;
    gl_ClipDistance[0] = clip_end - depth;
    view_depth = depth;
#ifdef ALPHA_TEST
    uv = in_uv;
#endif
#if defined(LIGHTS) || defined(WORLD)
    float distance_squared = dot(relative, relative);
    bool parallel = orthographic != 0 || distance_squared == 0.0;
    vec3 view = parallel ? -forward.xyz : -relative * inversesqrt(distance_squared);
    vec3 normal = world_normal(pose, in_normal) * (handedness(pose) * image_handedness);
    float squared = dot(normal, normal);
    normal *= inversesqrt(max(squared, 1e-37));
    // Without a usable normal either side faces the viewer.
    Reflected front = lit(vertex_shading(relative, squared > 0.0 ? normal : view, view));
    Reflected back = lit(vertex_shading(relative, squared > 0.0 ? -normal : view, view));
    front_diffuse = finite_radiance(front.diffuse);
    back_diffuse = finite_radiance(back.diffuse);
#ifdef SPECULAR
    front_glossy = finite_radiance(front.glossy);
    back_glossy = finite_radiance(back.glossy);
#endif
#endif
}
