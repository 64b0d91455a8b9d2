// SPDX-License-Identifier: GPL-3.0-or-later
// The plane that stands for a face's surface inside its cell, and how it is stored. Unit: cells, from the cell's centre.

#include "common/octahedral.glsl"

struct Plane
{
    vec3 normal;    // unit
    float distance; // along it
    vec3 low;       // box around the surface
    vec3 high;
};

// Boxes reach so far beyond their cells at most, cells.
const float LARGEST_EXCESS = 0.125;

/** Numbers in −½ − LARGEST_EXCESS … ½ + LARGEST_EXCESS as ten bits each; `rounding` 0: down, 1: up. */
uint pack_place(vec3 place, float rounding)
{
    uvec3 steps = uvec3(floor(clamp(place / (1.0 + 2.0 * LARGEST_EXCESS) + 0.5, 0.0, 1.0) * 1022.0 + rounding));
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
    return uvec4(packUnorm2x16(encode_octahedral(plane.normal)), floatBitsToUint(plane.distance),
                 pack_place(plane.low, 0.0), pack_place(plane.high, 1.0));
}

Plane decode_plane(uvec4 code)
{
    return Plane(decode_octahedral(unpackUnorm2x16(code.x)), uintBitsToFloat(code.y), unpack_place(code.z),
                 unpack_place(code.w));
}
