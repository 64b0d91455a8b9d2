// SPDX-License-Identifier: GPL-3.0-or-later
// What passes that find irradiance write.

#include "common/finite.glsl"
#include "common/luminance.glsl"

/** Irradiance (W/m²) and the variance of its luminance, both finite. `deviation`: square root of that variance. */
vec4 noisy_irradiance(vec3 irradiance, float deviation)
{
    return vec4(finite_radiance(irradiance), finite_radiance(vec3(deviation * deviation)).x);
}
