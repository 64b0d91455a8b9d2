// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of the nearest layer from the world, as far as the layers around a pixel leave it open.
// OCCLUSION: ambient obscurance; SSAO: share of the depths around that are not in front.

#include "common/camera.glsl"
#include "common/octahedral.glsl"
#include "generated/OcclusionUniforms.glsl"
#include "common/gather.glsl"
#include "common/environment.glsl"
#include "common/noisy_irradiance.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;

#include "common/screen_taps.glsl"
#ifdef OCCLUSION
#include "common/obscurance.glsl"
#endif

layout(location = 0) out vec4 out_irradiance;

/** Share of the world's irradiance that arrives, and its variance. */
struct Visibility
{
    float share;
    float variance;
};

#ifdef OCCLUSION
// What the mean of taps must be multiplied by to be the share of the irradiance that is lost: with it an endless corner
// of two walls, seen along its bisector from afar, gets exactly the half that it does. The mean there is an integral of
// `tap_obscurance` over the disc, which the bias and the softening leave without a closed form.
const float SHARE_OF_MEAN = 3.54021;

/** By ambient obscurance. */
Visibility visibility_of(ivec2 texel, ivec2 pixel, float view_depth, vec3 normal)
{
    vec3 position = relative_position(vec2(pixel) + 0.5, view_depth);
    Obscurance found = obscurance(texel, pixel, position, normal, view_depth, tap_radius);
    float scale = found.weight * SHARE_OF_MEAN;
    return Visibility(1.0 - min(scale * found.mean, found.weight), scale * scale * found.variance);
}
#endif

#ifdef SSAO
/** Whether any layer shows something in a pixel that is in front of a view depth (m), but less than the radius. */
bool in_front(ivec2 pixel, float view_depth)
{
    bool found = false;
    float nearest = view_depth - tap_radius, farthest = view_depth - 4.0 * FLOAT_EPSILON * view_depth;
    for (int layer = 0; layer < LAYERS; ++layer) {
        float depth = texelFetch(view_depth_layers, ivec3(pixel, layer), 0).r;
        found = found || (depth < farthest && depth > nearest);
    }
    return found;
}

/**
 * By comparing depths: where half of those around or more are not in front, all is open.
 *
 * They are taken in pairs on opposite sides of the pixel, so that of a plane, however tilted, exactly half are. What is
 * beyond the edge of the screen is taken for such a plane.
 */
Visibility visibility_of(ivec2 texel, ivec2 pixel, float view_depth, vec3 normal)
{
    vec2 disc = tap_radius * pixels_per_metre(view_depth);
    vec2 center = vec2(pixel) + 0.5;
    int pairs = (tap_count + 1) / 2;
    float open = 0.0;
    for (int pair = 0; pair < pairs; ++pair) {
        vec2 random = ray_random(texel_of_picture(texel), pair, pairs);
        float angle = 2.0 * PI * random.y;
        vec2 offset = round(disc * sqrt(random.x) * vec2(cos(angle), sin(angle)));
        if (on_screen(center + offset) && on_screen(center - offset)) {
            open += float(!in_front(pixel + ivec2(offset), view_depth));
            open += float(!in_front(pixel - ivec2(offset), view_depth));
        } else {
            open += 1.0;
        }
    }
    float share = 0.5 * open / float(pairs);
    return Visibility(min(2.0 * share, 1.0), share < 0.5 ? 2.0 * share * (1.0 - share) / float(pairs) : 0.0);
}
#endif

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 pixel = gathered_pixel(texel);
    float view_depth = texelFetch(view_depth_layers, ivec3(pixel, 0), 0).r;
    out_irradiance = vec4(0.0);
    if (isinf(view_depth))
        return;
    vec3 normal = decode_octahedral(texelFetch(normal_layers, ivec3(pixel, 0), 0).rg);
    Visibility visible = visibility_of(texel, pixel, view_depth, normal);
    vec3 irradiance = environment_irradiance(normal);
    out_irradiance = noisy_irradiance(visible.share * irradiance, sqrt(visible.variance) * luminance(irradiance));
}
