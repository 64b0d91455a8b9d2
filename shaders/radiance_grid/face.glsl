// SPDX-License-Identifier: GPL-3.0-or-later
// The face that a fragment stands for. Uniforms: FACE_UNIFORMS in render/grid/textures.py.

#include "generated/FaceUniforms.glsl"
#include "common/radiance_grid.glsl"

uniform usampler2D face_places;
uniform sampler2D face_points;  // mean point, cells from the cell's centre; area, m²

struct Face
{
    int level;
    int orientation;
    vec3 position;  // camera-relative, m
    vec3 normal;
    float cell;     // m
};

/** Number of the fragment's face. */
int this_face()
{
    return int(gl_FragCoord.y) * FACES_PER_ROW + int(gl_FragCoord.x);
}

Face fetch_face(int face)
{
    uvec2 place = texelFetch(face_places, face_texel(face), 0).rg;
    int level = int(place.y >> 3u);
    vec3 cell = vec3(place.x & 1023u, place.x >> 10u & 1023u, place.x >> 20u);
    vec3 offset = texelFetch(face_points, face_texel(face), 0).xyz;
    float size = grid_cell_size(level);
    vec3 position = grid_origins[level].xyz + (cell + 0.5 + offset) * size;
    return Face(level, int(place.y & 7u), position, fetch_plane(face).normal, size);
}
