// SPDX-License-Identifier: GPL-3.0-or-later
// Space: world axes with the camera's position as origin ("relative"). View depth is measured along the view axis.
// Pixels: of the whole guarded picture; the picture itself begins `guard_band` pixels from its left and lower edge.

#include "generated/CameraUniforms.glsl"

/** Point of the window, in camera space at view depth 1 (orthographic: at any depth), that a pixel looks through. */
vec2 window_point(vec2 pixel)
{
    return mix(camera_window.xz, camera_window.yw, pixel / camera_resolution);
}

/** Relative position (m) of what a pixel shows at a view depth (m). */
vec3 relative_position(vec2 pixel, float view_depth)
{
    vec2 point = window_point(pixel) * (camera_orthographic != 0 ? 1.0 : view_depth);
    return mat3(world_from_camera) * vec3(point, -view_depth);
}

/** Unit vector from the surface seen in a pixel towards the camera, world axes. */
vec3 view_direction(vec2 pixel)
{
    vec3 ray = camera_orthographic != 0 ? vec3(0.0, 0.0, -1.0) : vec3(window_point(pixel), -1.0);
    return -normalize(mat3(world_from_camera) * ray);
}

/** Metres that a pixel covers at a view depth (m). */
float pixel_width(float view_depth)
{
    vec2 pixel = abs(camera_window.yw - camera_window.xz) / camera_resolution;
    return max(pixel.x, pixel.y) * (camera_orthographic != 0 ? 1.0 : view_depth);
}
