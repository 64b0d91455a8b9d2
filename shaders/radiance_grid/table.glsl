// SPDX-License-Identifier: GPL-3.0-or-later
// The table of the radiance grid's cells, as render/grid/faces.py lays it out.

uniform usampler3D grid_cells;

/** Where a face is in the textures that hold them. */
ivec2 face_texel(int face)
{
    return ivec2(face % FACES_PER_ROW, face / FACES_PER_ROW);
}

/** Number of a cell's face of an orientation, which it must have. */
int face_of(uint entry, int orientation)
{
    return int(entry >> 6u) + bitCount(entry & ((1u << uint(orientation)) - 1u));
}

/** Which orientation a normal counts as: 0…5 for +X, −X, +Y, −Y, +Z, −Z. */
int orientation_of(vec3 normal)
{
    vec3 size = abs(normal);
    if (size.x >= size.y && size.x >= size.z)
        return normal.x >= 0.0 ? 0 : 1;
    if (size.y >= size.z)
        return normal.y >= 0.0 ? 2 : 3;
    return normal.z >= 0.0 ? 4 : 5;
}
