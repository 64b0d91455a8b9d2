// SPDX-License-Identifier: GPL-3.0-or-later
// Points on surfaces, each to the texel of the cell's face that its front belongs to. OCCUPANCY: to the texel that marks the
// face as there; otherwise to the one where the face's surface is added up.

#include "gbuffer/pose.glsl"
#include "generated/GridPointsUniforms.glsl"
#include "radiance_grid/table.glsl"

#ifndef OCCUPANCY
uniform usampler2D face_sources; // not 0 where a face is kept from an earlier grid
#endif

in vec3 in_position;
in vec3 in_normal;  // unit, of the triangle
#ifndef OCCUPANCY
in vec4 in_reach_low;   // how far the surface goes on from the point, each way along the object's axes, of REACH times
in vec4 in_reach_high;  // point_spacing; w: the share of point_area that the point stands for
#endif
#ifdef TEXTURE
in vec2 in_uv;
in float in_uv_scale;
#endif
#ifdef ATTRIBUTE
in vec4 in_color;
#endif
#ifdef EMISSION
in vec2 in_glow;    // whether the front and the back of the instance send the light that they emit
#endif

flat out vec3 offset;       // from the cell's centre, cells
flat out vec3 normal;       // unit, world space
#ifndef OCCUPANCY
flat out float area;        // m²
flat out vec3 low;          // box around the point's surface, from the cell's centre, cells
flat out vec3 high;
#endif
#ifdef TEXTURE
flat out vec2 uv;
flat out float uv_scale;
#endif
#ifdef ATTRIBUTE
flat out vec3 color;
#endif
#ifdef EMISSION
flat out vec2 glow;
#endif

/** Clip-space position of the centre of a texel of what is drawn into. */
vec4 at_texel(int index)
{
    int width = int(target_size.x);
    vec2 texel = vec2(index % width, index / width) + 0.5;
    return vec4(2.0 * texel / target_size - 1.0, 0.0, 1.0);
}

void main()
{
    const vec4 NOWHERE = vec4(2.0, 2.0, 2.0, 1.0);
    Pose pose = Pose(in_row_0, in_row_1, in_row_2, in_translation_low);
    vec3 place = relative_to(level_high.xyz, level_low.xyz, pose, in_position) / level_cell;
    vec3 scaled = world_normal(pose, in_normal);
    float scale = length(scaled);
    ivec3 cell = ivec3(floor(place)), size = ivec3(level_size.xyz);
    bool within = all(greaterThanEqual(cell, ivec3(0))) && all(lessThan(cell, size)) && scale > 0.0;
    normal = scaled / max(scale, 1e-30);
    offset = place - (vec3(cell) + 0.5);
    cell = clamp(cell, ivec3(0), size - 1);
    int orientation = orientation_of(normal);
#ifndef OCCUPANCY
    area = point_area * in_reach_low.w * scale;
    for (int axis = 0; axis < 3; ++axis) {
        vec3 row = (axis == 0 ? in_row_0 : axis == 1 ? in_row_1 : in_row_2).xyz * (REACH * point_spacing / level_cell);
        low[axis] = offset[axis] - dot(max(row, 0.0), in_reach_low.xyz) + dot(min(row, 0.0), in_reach_high.xyz);
        high[axis] = offset[axis] + dot(max(row, 0.0), in_reach_high.xyz) - dot(min(row, 0.0), in_reach_low.xyz);
    }
#endif
#ifdef OCCUPANCY
    int index = 6 * (cell.x + size.x * (cell.y + size.y * cell.z)) + orientation;
#else
    uint entry = texelFetch(grid_cells, cell + ivec3(0, 0, int(level_size.w)), 0).r;
    int index = face_of(entry, orientation);
    within = within && (entry >> uint(orientation) & 1u) != 0u;
    within = within && texelFetch(face_sources, face_texel(within ? index : 0), 0).r == 0u;
#endif
    gl_Position = within ? at_texel(index) : NOWHERE;
#ifdef TEXTURE
    uv = in_uv;
    uv_scale = in_uv_scale;
#endif
#ifdef ATTRIBUTE
    color = in_color.rgb;
#endif
#ifdef EMISSION
    glow = in_glow;
#endif
}
