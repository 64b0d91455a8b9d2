// SPDX-License-Identifier: GPL-3.0-or-later
// The surfaces that gathered texels look at, for all steps of the filter: camera-space normal and view depth (m), all 0
// where there is nothing to take light from.

#include "generated/FilterUniforms.glsl"
#include "common/camera.glsl"
#include "common/gather.glsl"
#include "common/same_surface.glsl"

uniform sampler2DArray surfaces;

/** What a texel looks at, and from which pixel. */
struct Seen {
    vec3 normal;
    float view_depth;
    vec2 pixel;
};

/** What a texel of the gathered target looks at. */
Seen seen_by(ivec2 texel)
{
    vec4 stored = texelFetch(surfaces, ivec3(texel, 0), 0);
    return Seen(stored.xyz, stored.w, vec2(gathered_pixel(texel)));
}

/** The plane of what is seen. */
SurfacePlane plane_of(Seen seen)
{
    vec2 pixel_size = (camera_window.yw - camera_window.xz) / camera_resolution;
    return surface_plane(seen.normal, seen.view_depth, window_point(seen.pixel + 0.5), pixel_size,
                         camera_orthographic == 0);
}

/** How far (m) from a plane at a view depth (m) other pixels may show the same surface: what a gathered texel covers. */
float tolerance_at(float view_depth)
{
    return float(gather_divisor) * pixel_width(view_depth);
}

/** 0…1: whether what another texel sees belongs to the surface of `seen`. */
float same_surface(Seen seen, SurfacePlane plane, float tolerance, Seen other)
{
    float off_plane = plane_distance(plane, other.pixel - seen.pixel, other.view_depth);
    return normal_weight(seen.normal, other.normal) * plane_weight(off_plane, tolerance);
}
