// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of one layer from the layers around. PAPER: as the method's authors put it together, with ambient
// obscurance, which is not energy-correct. WORLD: there is world light.

#include "common/camera.glsl"
#include "generated/RadiosityUniforms.glsl"
#include "common/gather.glsl"
#include "common/noisy_irradiance.glsl"

uniform sampler2DArray view_depth_layers;

#include "common/screen_taps.glsl"
#include "radiosity/gather.glsl"
#ifdef PAPER
#include "radiosity/paper.glsl"
#ifdef WORLD
#include "common/environment.glsl"
#endif
#endif

layout(location = 0) out vec4 out_irradiance;

/** Irradiance (W/m²) by the senders found, and the square root of the variance of its luminance. */
vec4 energy_correct_irradiance(Senders senders)
{
    // The estimator times its confidence: taps that found nothing count as dark. Where what was found is so far above
    // the horizon that it would send more than a hemisphere of its brightest could, it counts as all of the hemisphere.
    float weight = min(2.0 * PI / max(max(senders.count, senders.taps), 1.0), PI / max(senders.cosines, 1e-6));
    return weight * vec4(senders.radiance, deviation_of_sum(senders));
}

#ifdef PAPER
/**
 * Irradiance and the square root of the variance of its luminance, as the authors put it together: what was found, by
 * confidence in it, and the less of that, the more of the world's light.
 */
vec4 paper_irradiance(Senders senders, vec3 normal, float accessibility)
{
    float confidence = min(senders.count / max(senders.taps, 1.0), 1.0);
    confidence = clamp(2.0 * (confidence - 0.35) + 0.35, 0.0, 1.0);
    vec4 irradiance = 2.0 * PI / max(senders.count, 1.0) * vec4(senders.radiance, deviation_of_sum(senders));
    vec3 ambient = vec3(0.0);
#ifdef WORLD
    ambient = environment_irradiance(normal);
#endif
    return accessibility * vec4(confidence * irradiance.rgb + mix(1.0, 0.3, confidence) * ambient,
                                confidence * irradiance.a);
}
#endif

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec2 pixel = gathered_pixel(texel);
    ivec3 receiver = ivec3(pixel, layer);
    float view_depth = texelFetch(view_depth_layers, receiver, 0).r;
    out_irradiance = vec4(0.0);
    if (isinf(view_depth))
        return;
    vec3 position = relative_position(vec2(pixel) + 0.5, view_depth);
    vec3 normal = decode_octahedral(texelFetch(normal_layers, receiver, 0).rg);
    Senders senders = gather_senders(texel, pixel, position, normal, view_depth);
#ifdef PAPER
    Obscurance found = obscurance(texel, pixel, position, normal, view_depth, OBSCURANCE_SHARE * tap_radius);
    vec4 irradiance = paper_irradiance(senders, normal, paper_accessibility(found));
#else
    vec4 irradiance = energy_correct_irradiance(senders);
#endif
    out_irradiance = noisy_irradiance(irradiance.rgb, irradiance.a);
}
