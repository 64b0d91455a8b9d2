// SPDX-License-Identifier: GPL-3.0-or-later
// The radiance grid: nested levels of cubic cells, each twice as large as those of the level before. Of each cell up to
// six faces are kept, one for the surfaces whose normals are nearest to an axis; see render/grid/faces.py.
// Positions are camera-relative, m. Uniforms: GRID_UNIFORMS in render/grid/textures.py.

#include "radiance_grid/plane.glsl"
#include "radiance_grid/table.glsl"

uniform usampler2D face_planes;

const int NO_FACE = -1;
/** The plane of a face. */
Plane fetch_plane(int face)
{
    return decode_plane(texelFetch(face_planes, face_texel(face), 0));
}

/** Side of a level's cells, m. */
float grid_cell_size(int level)
{
    return grid_origins[level].w;
}

/** A position in cells from a level's lowest corner. */
vec3 grid_place(vec3 position, int level)
{
    return (position - grid_origins[level].xyz) / grid_origins[level].w;
}

/** What the table says of a cell of a level, which it must have. */
uint grid_entry(ivec3 cell, int level)
{
    return texelFetch(grid_cells, cell + ivec3(0, 0, int(grid_sizes[level].w)), 0).r;
}

/** Whether a level has a cell. */
bool grid_has(ivec3 cell, int level)
{
    return all(greaterThanEqual(cell, ivec3(0))) && all(lessThan(cell, ivec3(grid_sizes[level].xyz)));
}

/** Bits of the orientations that a ray may meet from their front: normals are up to 54.7° away from their axis. */
uint facing_orientations(vec3 direction)
{
    const float SINE = 0.8165;
    uvec3 positive = uvec3(1u, 4u, 16u) * uvec3(lessThan(direction, vec3(SINE)));
    uvec3 negative = uvec3(2u, 8u, 32u) * uvec3(greaterThan(direction, vec3(-SINE)));
    return positive.x | positive.y | positive.z | negative.x | negative.y | negative.z;
}

struct GridHit
{
    int face;       // NO_FACE: the ray left the grid
    float distance; // m
};

/**
 * The first face that a ray meets from its front, after Amanatides and Woo 1987, "A Fast Voxel Traversal Algorithm".
 *
 * `random`, in 0…1, another for each ray: surfaces that fill a part of their box are met by as many rays. It goes through
 * each level from `first_level` on for `grid_reach` cells at most, then through the next coarser one.
 */
GridHit trace_grid(vec3 origin, vec3 direction, int first_level, float random)
{
    const float FAR = 1e30;
    uint facing = facing_orientations(direction);
    vec3 inverse_direction = 1.0 / mix(direction, vec3(1e-12), lessThan(abs(direction), vec3(1e-12)));
    ivec3 forward = ivec3(sign(inverse_direction));
    GridHit hit = GridHit(NO_FACE, FAR);
    float travelled = 0.0;
    for (int level = first_level; level < grid_level_count && hit.face == NO_FACE; ++level) {
        float cell_size = grid_cell_size(level);
        vec3 size = grid_sizes[level].xyz;
        vec3 place = grid_place(origin, level);
        // Distances are in cells of this level from here on.
        vec3 to_low = -place * inverse_direction, to_high = (size - place) * inverse_direction;
        vec3 entries = min(to_low, to_high), exits = max(to_low, to_high);
        float enter = max(max(entries.x, entries.y), max(entries.z, travelled / cell_size));
        float leave = min(exits.x, min(exits.y, exits.z));
        if (level < grid_level_count - 1)
            leave = min(leave, enter + grid_reach);
        vec3 at = place + enter * direction;
        ivec3 cell = clamp(ivec3(floor(at)), ivec3(0), ivec3(size) - 1);
        vec3 next = (vec3(cell + max(forward, ivec3(0))) - place) * inverse_direction;
        vec3 step_length = abs(inverse_direction);
        float t = enter;
        bool within = enter < leave;
        while (within && t < leave && hit.face == NO_FACE) {
            uint entry = grid_entry(cell, level);
            float t_next = min(next.x, min(next.y, next.z));
            uint candidates = entry & facing;
            // A loop in place of branches: drivers that draw on the CPU would run them for every step.
            for (; candidates != 0u; candidates &= candidates - 1u) {
                int face = face_of(entry, findLSB(candidates));
                Plane plane = fetch_plane(face);
                vec3 from = place - (vec3(cell) + 0.5);
                float approach = dot(plane.normal, direction);
                float meets = (plane.distance - dot(plane.normal, from)) / min(approach, -1e-6);
                vec3 point = from + meets * direction;
                bool inside = all(greaterThanEqual(point, plane.low)) && all(lessThanEqual(point, plane.high));
                if (inside && approach < 0.0 && plane.coverage > random && meets >= enter && meets * cell_size < hit.distance)
                    hit = GridHit(face, meets * cell_size);
            }
            bvec3 nearest = lessThanEqual(next, vec3(t_next));
            cell += ivec3(nearest) * forward;
            next += vec3(nearest) * step_length;
            t = t_next;
            within = grid_has(cell, level);
        }
        travelled = max(travelled, min(t, leave) * cell_size);
    }
    return hit;
}
