// SPDX-License-Identifier: GPL-3.0-or-later

// Far above any light, and sums of a billion samples of it are still finite.
const float LARGEST_RADIANCE = 1e29;

/** Radiance without what must never reach a target that is read again: NaN becomes 0, infinity a very large value. */
vec3 finite_radiance(vec3 radiance)
{
    return any(isnan(radiance)) ? vec3(0.0) : min(radiance, vec3(LARGEST_RADIANCE));
}

/** Whether all components are numbers no larger than `finite_radiance` lets through. */
bool is_finite(vec4 value)
{
    return !any(isnan(value)) && all(lessThanEqual(abs(value), vec4(LARGEST_RADIANCE)));
}
