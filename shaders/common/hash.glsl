// SPDX-License-Identifier: GPL-3.0-or-later

/** Two numbers in [0, 1) that look independent for neighbouring inputs (Jarzynski and Olano 2020, PCG2D). */
vec2 hash_to_unit(uvec2 v)
{
    v = v * 1664525u + 1013904223u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16u;
    return vec2(v >> 8u) * (1.0 / 16777216.0);
}
