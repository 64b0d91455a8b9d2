// SPDX-License-Identifier: GPL-3.0-or-later
// How far each of many lights reaches in the current sample: render/light_reach.py says why, and that it is unbiased.

#include "common/lights.glsl"

/** R² (m²): nothing at this squared distance from the middle of a light, or farther, is lit by it in this sample. */
float light_reach_squared(int index)
{
    return texelFetch(light_samples, light_texel(index, TEXELS_PER_SAMPLE) + ivec2(2, 0), 0).x;
}

/** Factor on the light that arrives at a squared distance (m²) from the middle of a light; 0 beyond its reach. */
float light_reach_weight(int index, float distance_squared)
{
    vec2 reach_squared = texelFetch(light_samples, light_texel(index, TEXELS_PER_SAMPLE) + ivec2(2, 0), 0).xy;
    return distance_squared < reach_squared.x ? max(distance_squared / reach_squared.y, 1.0) : 0.0;
}
