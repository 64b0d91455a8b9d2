// SPDX-License-Identifier: GPL-3.0-or-later
// How much of its surroundings within a radius a surface does not see past the deep G-buffer's layers: the ambient
// obscurance of Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination Approximation". LAYERS: how many.
// Needs common/screen_taps.glsl.

// Exponent of the offset, pixels, up to which taps are not subsampled, less one.
const int OBSCURANCE_FINEST = 3;

// Of the radius: surfaces less far above the horizon do not obscure, and (of its square) what keeps near ones bounded.
// The authors' 23 mm and 1000 mm² at a radius of 750 mm.
const float OBSCURANCE_BIAS = 0.023 / 0.75;
const float OBSCURANCE_SOFTENING = 1e-3 / (0.75 * 0.75);

// Pixels. A smaller disc holds too few pixels to tell anything.
const float SMALLEST_DISC = 3.0;

/** Mean and variance of the mean of the taps' obscurance, and the weight 0…1 that a small disc leaves them. */
struct Obscurance
{
    float mean;
    float variance;
    float weight;
};

/** Obscurance by what is `offset` (m) away, 0…1. `bias` (m). */
float tap_obscurance(vec3 offset, vec3 normal, float radius, float bias)
{
    float squared = dot(offset, offset);
    if (!(squared < radius * radius))
        return 0.0; // not a number where there is nothing
    float elevation = (dot(offset, normal) - bias) * inversesqrt(squared + OBSCURANCE_SOFTENING * radius * radius);
    return (1.0 - squared / (radius * radius)) * max(elevation, 0.0);
}

/** Obscurance of what a pixel shows in the nearest layer. `position` and `radius` in m. */
Obscurance obscurance(ivec2 texel, ivec2 pixel, vec3 position, vec3 normal, float view_depth, float radius)
{
    vec2 disc = radius * pixels_per_metre(view_depth);
    float phase = spiral_phase(texel);
    float bias = OBSCURANCE_BIAS * radius + 4.0 * FLOAT_EPSILON * view_depth;
    float within_step = fract(gather_shift.y + 0.5);
    float count = 0.0, sum = 0.0, squares = 0.0;
    for (int tap = 0; tap < tap_count; ++tap) {
        vec2 offset = spiral_offset((float(tap) + within_step) / float(tap_count), phase, disc);
        vec2 place = vec2(pixel) + 0.5 + offset;
        if (!on_screen(place))
            continue;
        ivec2 tapped = subsampled_pixel(ivec2(place), tap_level(offset, OBSCURANCE_FINEST));
        float largest = 0.0;
        for (int layer = 0; layer < LAYERS; ++layer)
            largest = max(largest, tap_obscurance(layer_position(tapped, layer) - position, normal, radius, bias));
        count += 1.0;
        sum += largest;
        squares += largest * largest;
    }
    float mean = sum / max(count, 1.0);
    float variance = max(squares / max(count, 1.0) - mean * mean, 0.0) / max(count - 1.0, 1.0);
    return Obscurance(mean, variance, clamp(min(disc.x, disc.y) - SMALLEST_DISC, 0.0, 1.0));
}
