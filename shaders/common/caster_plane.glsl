// SPDX-License-Identifier: GPL-3.0-or-later
// How shadow maps store by how much a caster's nearness changes per texel.

// The code is within 2⁻¹⁵ of its ends, where slopes are infinite.
const float LARGEST_CODE = 1.0 - 1.0 / 32768.0;

/** Change of nearness per texel of a surface at 45° to the map; `texel`: width at distance 1, orthographic: m. */
float slope_unit(bool orthographic, float nearness, float texel)
{
    return orthographic ? texel : texel * nearness;
}

/** Slopes along x and y as 16 bits each; relative to 1 + |slope| off by at most 2⁻¹⁵ (1 + |slope|). */
uint encode_slope(vec2 slope)
{
    vec2 code = clamp(slope / (1.0 + abs(slope)), -LARGEST_CODE, LARGEST_CODE);
    return packUnorm2x16(0.5 + 0.5 * code);
}

/** The inverse of `encode_slope`. */
vec2 decode_slope(uint bits)
{
    vec2 code = clamp(2.0 * unpackUnorm2x16(bits) - 1.0, -LARGEST_CODE, LARGEST_CODE);
    return code / (1.0 - abs(code));
}
