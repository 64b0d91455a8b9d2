// SPDX-License-Identifier: GPL-3.0-or-later
// Whether two pixels show one surface: what keeps filters from mixing light across edges. Weights of edge-aware
// filters usually have no end (Schied et al. 2017); these are exactly 0 from some difference on. Space: the camera's.

// 1 − cosine of the angle between normals of different surfaces, 26°. Mara et al. 2016 take 13°, by which columns and
// arches a few dozen pixels wide would find no neighbours.
const float DIFFERENT_NORMALS = 0.1;

/** 1 for equal unit normals, falling to 0 where they belong to different surfaces; 0 as well if one of them is 0. */
float normal_weight(vec3 first, vec3 second)
{
    return clamp(1.0 - (1.0 - dot(first, second)) / DIFFERENT_NORMALS, 0.0, 1.0);
}

/** The plane of what a pixel shows: by how much the distance from it grows across the picture and along the view. */
struct SurfacePlane {
    vec2 per_pixel; // at a view depth of 1 m; orthographic: at any
    float per_metre;
    float view_depth; // m
    bool perspective;
};

/**
 * The plane with a unit normal through what is seen at a view depth (m).
 *
 * `window_point`: the point of the window, at view depth 1, that the pixel looks through. `pixel_size`: of a pixel in
 * that window.
 */
SurfacePlane surface_plane(vec3 normal, float view_depth, vec2 window_point, vec2 pixel_size, bool perspective)
{
    float across = perspective ? dot(normal.xy, window_point) : 0.0;
    return SurfacePlane(normal.xy * pixel_size, across - normal.z, view_depth, perspective);
}

/** Distance (m) from a plane of what is seen `pixels` beside its point. From differences: nothing large cancels. */
float plane_distance(SurfacePlane plane, vec2 pixels, float view_depth)
{
    float across = dot(plane.per_pixel, pixels) * (plane.perspective ? view_depth : 1.0);
    return abs(across + plane.per_metre * (view_depth - plane.view_depth));
}

/** 1 in a plane, falling to 0 as the distance from it reaches a `tolerance`; both in metres. */
float plane_weight(float off_plane, float tolerance)
{
    float ratio = off_plane / tolerance;
    return max(1.0 - ratio * ratio, 0.0);
}
