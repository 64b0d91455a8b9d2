// SPDX-License-Identifier: GPL-3.0-or-later
// Faces' planes, colours and emission from what their points added up: those that show them their front, and those of
// the opposite face, which show them their back.

#include "radiance_grid/plane.glsl"
#include "radiance_grid/table.glsl"
#include "generated/FaceUniforms.glsl"

uniform usampler2D face_places;
uniform sampler2D sum_base_color;
uniform sampler2D sum_offset;
uniform sampler2D sum_normal;
uniform sampler2D sum_emission;
uniform sampler2D most;
uniform sampler2D least;

layout(location = 0) out uvec4 out_plane;
layout(location = 1) out vec4 out_point;
layout(location = 2) out vec4 out_albedo;
layout(location = 3) out vec4 out_emission;

// Where surfaces go on in the next cell, rays may miss them by this part of a cell, or they would slip through between two
// planes that were fitted to a curved one.
const float PLANE_TOLERANCE = 0.2;

/** How far a surface whose points reach to `extent` (0…½) from a cell's centre does: those that reach its side go on. */
vec3 reach(vec3 extent)
{
    return mix(extent, vec3(0.5 + PLANE_TOLERANCE), greaterThan(extent, vec3(0.49)));
}

// Points tell the area in a cell no better than to about this part: closed surfaces must stay closed.
const float AREA_PRECISION = 0.5;

/**
 * Area (squares of a cell's side) of the part of a plane (unit normal, distance from the cell's centre) inside a box:
 * from lines through it along the axis that the normal is nearest to.
 */
float area_in_box(vec3 normal, float distance, vec3 low, vec3 high)
{
    const int LINES = 8; // each way
    vec3 size = abs(normal);
    int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    int inside = 0;
    for (int line = 0; line < LINES * LINES; ++line) {
        vec2 place = (vec2(line % LINES, line / LINES) + 0.5) / float(LINES);
        vec3 point = vec3(0.0);
        point[u] = mix(low[u], high[u], place.x);
        point[v] = mix(low[v], high[v], place.y);
        float height = (distance - dot(normal, point)) / normal[axis];
        inside += height >= low[axis] && height <= high[axis] ? 1 : 0;
    }
    return float(inside) / float(LINES * LINES) * (high[u] - low[u]) * (high[v] - low[v]) / size[axis];
}

/**
 * How much more than the mean of all a face's surface what shows of it emits: where there is more than its plane has room
 * for (`area_ratio` > 1), such as a panel below a ceiling, what glows hides the rest. `strongest`: channel of its emission.
 */
float unhidden(float area_ratio, vec3 emission, float strongest)
{
    float channel = max(emission.r, max(emission.g, emission.b));
    return channel > 0.0 ? clamp(area_ratio, 1.0, max(strongest / channel, 1.0)) : 1.0;
}

void main()
{
    int face = int(gl_FragCoord.y) * FACES_PER_ROW + int(gl_FragCoord.x);
    if (face < first_face || face >= end_face)
        discard;
    ivec2 own = face_texel(face);
    // Every cell has opposite faces together, one after the other.
    bool positive = (texelFetch(face_places, own, 0).g & 1u) == 0u;
    ivec2 other = face_texel(positive ? face + 1 : face - 1);
    vec4 base_color = texelFetch(sum_base_color, own, 0) + texelFetch(sum_base_color, other, 0);
    vec4 offsets = texelFetch(sum_offset, own, 0), other_offsets = texelFetch(sum_offset, other, 0);
    vec4 normals = texelFetch(sum_normal, own, 0), other_normals = texelFetch(sum_normal, other, 0);
    vec4 emissions = texelFetch(sum_emission, own, 0), other_emissions = texelFetch(sum_emission, other, 0);
    float area = max(base_color.a, 1e-37);
    vec3 normal = normals.xyz - other_normals.xyz;
    normal /= max(length(normal), 1e-37);
    vec3 offset = (offsets.xyz + other_offsets.xyz) / area;
    vec4 own_most = texelFetch(most, own, 0), other_most = texelFetch(most, other, 0);
    vec4 own_least = texelFetch(least, own, 0), other_least = texelFetch(least, other, 0);
    vec3 high = max(own_most.xyz, other_most.xyz) - 0.5, low = max(own_least.xyz, other_least.xyz) - 0.5;
    vec3 low_end = -reach(low), high_end = reach(high);
    float distance = dot(normal, offset), level_cell = grid_origins[texelFetch(face_places, own, 0).g >> 3u].w;
    float within = area_in_box(normal, distance, max(low_end, -0.5), min(high_end, vec3(0.5))) * level_cell * level_cell;
    float coverage = base_color.a >= (1.0 - AREA_PRECISION) * within ? 1.0 : base_color.a / within;
    out_plane = encode_plane(Plane(normal, distance, low_end, high_end, coverage));
    out_point = vec4(offset, base_color.a);
    out_albedo = vec4(base_color.rgb / area, 1.0);
    vec3 emission = (emissions.rgb + vec3(other_offsets.a, other_normals.a, other_emissions.a)) / area;
    out_emission = vec4(emission * unhidden(base_color.a / within, emission, max(own_most.a, other_least.a)), 0.0);
}
