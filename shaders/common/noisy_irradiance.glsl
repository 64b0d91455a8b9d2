// SPDX-License-Identifier: GPL-3.0-or-later
// What passes that find irradiance write.

#include "common/finite.glsl"
#include "common/luminance.glsl"

/**
 * Standard deviation of the mean of some independent numbers, by their sum and the sum of their squares.
 *
 * Of a single one nothing is known but its own square.
 */
float mean_deviation(float sum, float sum_of_squares, int count)
{
    float share = 1.0 / float(max(count, 1)), mean = count > 1 ? sum * share : 0.0;
    return sqrt(max(sum_of_squares * share - mean * mean, 0.0) / float(max(count - 1, 1)));
}

/** Irradiance (W/m²) and the variance of its luminance, both finite. `deviation`: square root of that variance. */
vec4 noisy_irradiance(vec3 irradiance, float deviation)
{
    return vec4(finite_radiance(irradiance), finite_radiance(vec3(deviation * deviation)).x);
}
