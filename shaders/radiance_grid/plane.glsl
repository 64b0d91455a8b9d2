// SPDX-License-Identifier: GPL-3.0-or-later
// The plane that stands for a face's surface inside its cell, and how it is stored. Unit: cells, from the cell's centre.

#include "common/octahedral.glsl"

struct Plane
{
    vec3 normal;    // unit
    float distance; // along it
    vec3 low;       // box around the surface
    vec3 high;
    float coverage; // share of the plane inside the box that is surface, 0…1
};

// Boxes reach so far beyond their cells at most, cells.
const float LARGEST_EXCESS = 0.25;

/**
 * Numbers in −½ − LARGEST_EXCESS … ½ + LARGEST_EXCESS as ten bits each. `steps_up`: added to what is rounded down; −1 and
 * 2 round down and up with a step to spare, for boxes of flat surfaces have no thickness, and no ray may miss them so.
 */
uint pack_place(vec3 place, float steps_up)
{
    uvec3 steps = uvec3(clamp(floor((place / (1.0 + 2.0 * LARGEST_EXCESS) + 0.5) * 1022.0) + steps_up, 0.0, 1023.0));
    return steps.x | steps.y << 10u | steps.z << 20u;
}

/** What `pack_place` packed. */
vec3 unpack_place(uint packed_place)
{
    vec3 steps = vec3(packed_place & 1023u, packed_place >> 10u & 1023u, packed_place >> 20u & 1023u);
    return (steps / 1022.0 - 0.5) * (1.0 + 2.0 * LARGEST_EXCESS);
}

uvec4 encode_plane(Plane plane)
{
    // Four bits, two beside each of the box's corners.
    uint share = uint(clamp(plane.coverage, 0.0, 1.0) * 15.0 + 0.5);
    return uvec4(packUnorm2x16(encode_octahedral(plane.normal)), floatBitsToUint(plane.distance),
                 pack_place(plane.low, -1.0) | share << 30u, pack_place(plane.high, 2.0) | share >> 2u << 30u);
}

Plane decode_plane(uvec4 code)
{
    float coverage = float(code.z >> 30u | code.w >> 30u << 2u) / 15.0;
    return Plane(decode_octahedral(unpackUnorm2x16(code.x)), uintBitsToFloat(code.y), unpack_place(code.z),
                 unpack_place(code.w), coverage);
}
