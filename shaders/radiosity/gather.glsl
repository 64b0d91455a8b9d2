// SPDX-License-Identifier: GPL-3.0-or-later
// The estimator of Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination Approximation": what the layers
// around a pixel send to it, without asking what is in between. LAYERS: how many. RADIANCE: there is direct light.
// BOUNCED: and irradiance that the bounce before found. Needs common/screen_taps.glsl.

#include "common/luminance.glsl"
#include "common/layer_radiance.glsl"
#include "common/octahedral.glsl"
#ifdef BOUNCED
#include "common/bsdf.glsl"
#endif

uniform sampler2DArray normal_layers;
#ifdef BOUNCED
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
uniform sampler2DArray bounced_layers; // a texel for BOUNCE_DIVISOR² pixels
#endif

// Exponent of the offset, pixels, up to which taps are not subsampled, less one.
const int RADIOSITY_FINEST = 4;

// Cosine at the sender up to which its surface does not send: that of the receiver's own is 0 but for rounding.
const float SENDER_COSINE = 0.01;

// Of the radius: keeps the direction to what is at the same place bounded. The authors' 10⁻⁵ at 1 m.
const float DIRECTION_SOFTENING = 1e-5;

/** Sums over the taps' layers that may send. */
struct Senders
{
    vec3 radiance;    // times cosine at the receiver, W/(sr·m²)
    float cosines;    // at the receiver, of those that do send
    float squares;    // of the luminance of radiance times cosine
    float count;      // of those that may send
    float taps;       // on the screen
};

#ifdef BOUNCED
/** Radiance (W/(sr·m²)) that a layer reflects diffusely in a pixel of what the bounce before found. */
vec3 bounced_radiance(ivec3 texel, vec3 normal)
{
    vec4 base_color = texelFetch(base_color_layers, texel, 0);
    vec4 material = texelFetch(material_layers, texel, 0);
    float n_dot_v = clamp(dot(normal, view_direction(vec2(texel.xy) + 0.5)), 0.0, 1.0);
    Surface surface = make_surface(base_color.rgb, base_color.a, material.r, material.g, material.b, n_dot_v);
    vec3 albedo = min(diffuse_directional_albedo(surface, n_dot_v), vec3(1.0));
    return albedo / PI * texelFetch(bounced_layers, ivec3(texel.xy / BOUNCE_DIVISOR, texel.z), 0).rgb;
}
#endif

/** Radiance (W/(sr·m²)) that a layer with this normal sends in a pixel. */
vec3 sent_radiance(ivec3 texel, vec3 normal)
{
    vec3 radiance = shaded_radiance(texel);
#ifdef BOUNCED
    radiance += bounced_radiance(texel, normal);
#endif
    return radiance;
}

/** Add what a layer sends in a pixel to a receiver. */
void add_sender(ivec2 pixel, int layer, vec3 position, vec3 normal, inout Senders senders)
{
    vec3 offset = layer_position(pixel, layer) - position;
    float distance = length(offset);
    vec3 direction = offset / (distance + DIRECTION_SOFTENING * tap_radius);
    float cosine = dot(direction, normal);
    vec3 sender_normal = decode_octahedral(texelFetch(normal_layers, ivec3(pixel, layer), 0).rg);
    // What is empty is not a number away, and no comparison holds.
    if (!(cosine > 0.0 && -dot(direction, sender_normal) > SENDER_COSINE))
        return;
    senders.count += 1.0;
    if (!(distance < tap_radius))
        return;
    vec3 sent = cosine * sent_radiance(ivec3(pixel, layer), sender_normal);
    float brightness = luminance(sent);
    senders.radiance += sent;
    senders.cosines += cosine;
    senders.squares += brightness * brightness;
}

/** All that may send to what `layer` shows in a pixel. `position` (m) relative, `view_depth` (m). */
Senders gather_senders(ivec2 texel, ivec2 pixel, vec3 position, vec3 normal, float view_depth)
{
    vec2 disc = tap_radius * pixels_per_metre(view_depth);
    float phase = spiral_phase(texel);
    float jitter = mix(0.1, 0.9, ray_random(texel_of_picture(texel), 0, 1).x);
    Senders senders = Senders(vec3(0.0), 0.0, 0.0, 0.0, 0.0);
    for (int tap = 0; tap < tap_count; ++tap) {
        vec2 offset = spiral_offset((float(tap) + jitter) / float(tap_count), phase, disc);
        vec2 place = vec2(pixel) + 0.5 + offset;
        if (!on_screen(place))
            continue;
        senders.taps += 1.0;
        ivec2 tapped = subsampled_pixel(ivec2(place), tap_level(offset, RADIOSITY_FINEST));
        for (int layer = 0; layer < LAYERS; ++layer)
            add_sender(tapped, layer, position, normal, senders);
    }
    return senders;
}

/** Square root of the variance of the luminance of `radiance` in a sum over taps, those that found nothing included. */
float deviation_of_sum(Senders senders)
{
    float taps = max(senders.taps, 1.0);
    float mean = luminance(senders.radiance) / taps;
    return sqrt(max(senders.squares - taps * mean * mean, 0.0) * taps / max(taps - 1.0, 1.0));
}
