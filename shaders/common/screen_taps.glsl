// SPDX-License-Identifier: GPL-3.0-or-later
// Where passes look around a pixel: taps along a spiral in the disc that a radius covers on the screen, the farther
// away the coarser (McGuire et al. 2012, "Scalable Ambient Obscurance"). Uniforms: TAP_UNIFORMS in
// render/screen_taps.py. Needs common/camera.glsl and common/gather.glsl.

// Pixels. No tap is nearer: it would meet the pixel itself.
const float SMALLEST_OFFSET = 0.75;
const int COARSEST_LEVEL = 5;

/** Pixels, along x and y, that a metre across the view covers at a view depth (m). */
vec2 pixels_per_metre(float view_depth)
{
    vec2 window = abs(camera_window.yw - camera_window.xz);
    return camera_resolution / (window * (camera_orthographic != 0 ? 1.0 : view_depth));
}

/** A texel counted from the picture's corner, so that a guard band does not change what its taps are. */
ivec2 texel_of_picture(ivec2 texel)
{
    return texel - guard_band / gather_divisor;
}

/** Turns, 0…1, by which a texel's spiral differs from the others' in this sample. */
float spiral_phase(ivec2 texel)
{
    ivec2 place = texel_of_picture(texel);
    int hash = (3 * place.x) ^ (place.y + place.x * place.y);
    return fract(float(hash & 1023) * (10.0 / (2.0 * PI)) + gather_shift.x);
}

/** Pixels from the centre of a spiral of this `radius` (pixels, x and y) to where it is a fraction 0…1 of it away. */
vec2 spiral_offset(float fraction, float phase, vec2 radius)
{
    float angle = 2.0 * PI * fract(fraction * tap_turns + phase);
    return max(fraction * radius, vec2(SMALLEST_OFFSET)) * vec2(cos(angle), sin(angle));
}

/**
 * The pixel that stands for all 2^level × 2^level around one: each level of a pyramid keeps one of four pixels of the
 * finer one, on a rotated grid. Depth is never averaged.
 */
ivec2 subsampled_pixel(ivec2 pixel, int level)
{
    ivec2 texel = pixel >> level;
    for (int finer = 0; finer < level; ++finer)
        texel = 2 * texel + ((texel.yx & 1) ^ 1);
    return min(texel, ivec2(camera_resolution) - 1);
}

/** How many levels coarser a tap looks at an offset (pixels): none below 2^(finest + 1), and one more each octave. */
int tap_level(vec2 offset, int finest)
{
    int exponent = int(floatBitsToUint(length(offset)) >> 23u) - 127; // of the greatest power of two below
    return clamp(exponent - finest, 0, COARSEST_LEVEL);
}

/** Whether a place (pixels) is on the guarded picture. */
bool on_screen(vec2 place)
{
    return all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, camera_resolution));
}

/** Relative position (m) of what a layer shows in a pixel; infinite or not a number where it is empty. */
vec3 layer_position(ivec2 pixel, int layer)
{
    return relative_position(vec2(pixel) + 0.5, texelFetch(view_depth_layers, ivec3(pixel, layer), 0).r);
}
