// SPDX-License-Identifier: GPL-3.0-or-later

/** The value, or zero where any component is infinite or not a number: nothing else may reach a target that is read again. */
vec3 finite_or_zero(vec3 value)
{
    return any(isnan(value)) || any(isinf(value)) ? vec3(0.0) : value;
}
