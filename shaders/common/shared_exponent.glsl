// SPDX-License-Identifier: GPL-3.0-or-later
// Radiance in four halves: three components over one power of two, whose exponent is the fourth. The range of float32
// in half its size; each component is off by at most 2^-11 of the largest.

/** 2^exponent, exactly, for −126…127. */
float power_of_two(int exponent)
{
    return uintBitsToFloat(uint(exponent + 127) << 23u);
}

/** Round to the 11 binary digits of a half here: drivers differ in whether storing one rounds or cuts off. */
vec3 round_to_half(vec3 value)
{
    return uintBitsToFloat((floatBitsToUint(value) + 0x1000u) & ~0x1fffu);
}

/** Radiance below 2^127 -> components over 2^e, and e. Drivers may take what is below 2^-126 for zero. */
vec4 encode_shared_exponent(vec3 radiance)
{
    vec3 magnitude = abs(radiance);
    float largest = max(magnitude.r, max(magnitude.g, magnitude.b));
    if (largest == 0.0)
        return vec4(0.0);
    int exponent = max(int(floatBitsToUint(largest) >> 23u) - 127, -126);
    return vec4(round_to_half(radiance * power_of_two(-exponent)), float(exponent));
}

/** The inverse of encode_shared_exponent. */
vec3 decode_shared_exponent(vec4 encoded)
{
    return encoded.rgb * power_of_two(int(encoded.a));
}
