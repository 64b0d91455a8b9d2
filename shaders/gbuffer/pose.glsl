// SPDX-License-Identifier: GPL-3.0-or-later
// Where instances are in the world.

in vec4 in_row_0; // rows of world-from-object
in vec4 in_row_1;
in vec4 in_row_2;
in vec3 in_translation_low; // what float32 loses of the fourth column

/** Rows of world-from-object with what float32 loses of the translation. */
struct Pose
{
    vec4 row_0;
    vec4 row_1;
    vec4 row_2;
    vec3 translation_low;
};

/** −1 where a pose mirrors, else 1. */
float handedness(Pose pose)
{
    return dot(pose.row_0.xyz, cross(pose.row_1.xyz, pose.row_2.xyz)) < 0.0 ? -1.0 : 1.0;
}

/** Object-space normal to world axes, of any length, on the side of a triangle's front by its winding there. */
vec3 world_normal(Pose pose, vec3 normal)
{
    // The cofactor matrix carries normals; its sign, unlike the inverse transpose's, does not depend on mirroring.
    return handedness(pose) * vec3(dot(cross(pose.row_1.xyz, pose.row_2.xyz), normal),
                                   dot(cross(pose.row_2.xyz, pose.row_0.xyz), normal),
                                   dot(cross(pose.row_0.xyz, pose.row_1.xyz), normal));
}

/** Object-space position (m) to world axes with a camera's position, given as two float32 parts, as origin. */
vec3 relative_to(vec3 camera_high, vec3 camera_low, Pose pose, vec3 position)
{
    // Part by part: the high parts cancel exactly where object and camera are near each other.
    precise vec3 high = vec3(pose.row_0.w, pose.row_1.w, pose.row_2.w) - camera_high;
    precise vec3 translation = high + (pose.translation_low - camera_low);
    precise vec3 relative = vec3(dot(pose.row_0.xyz, position), dot(pose.row_1.xyz, position),
                                 dot(pose.row_2.xyz, position)) + translation;
    return relative;
}
