// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of one layer by rays marched through all of them: what they meet sends, or else the world.

#include "common/deep_march.glsl"
#include "common/hash.glsl"
#include "common/noisy_irradiance.glsl"
#include "common/layer_radiance.glsl"
#include "common/octahedral.glsl"
#include "generated/DeepMarchUniforms.glsl"
#include "common/environment.glsl"
#include "common/gather.glsl"

uniform sampler2DArray normal_layers;
#ifdef BOUNCED
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
uniform sampler2DArray bounced_layers; // irradiance (W/m²) of all layers by the bounces before, of fewer texels
#endif

#if defined(DEBUG_MARCH_HITS) || defined(DEBUG_LIGHT_ORIGIN)
#define DEBUG_ORIGIN
#endif

layout(location = 0) out vec4 out_irradiance;
#ifdef DEBUG_ORIGIN
layout(location = 1) out vec4 out_origin;
#endif

/** Radiance, W/(sr·m²), that a texel of the layers sends. */
vec3 sent_radiance(ivec3 texel)
{
    vec3 radiance = shaded_radiance(texel);
#ifdef BOUNCED
    float metallic = texelFetch(material_layers, texel, 0).r;
    vec3 albedo = min(texelFetch(base_color_layers, texel, 0).rgb, 1.0) * (1.0 - metallic);
    radiance += albedo / PI * texelFetch(bounced_layers, ivec3(texel.xy / BOUNCE_DIVISOR, texel.z), 0).rgb;
#endif
    return radiance;
}

/** Radiance that arrives along a ray from a layer that it met, or from the world, but none from where nobody sees. */
vec3 arriving_radiance(MarchHit hit, vec3 direction)
{
    if (hit.hit) {
        ivec3 texel = ivec3(hit.pixel, hit.layer);
        vec3 normal = decode_octahedral(texelFetch(normal_layers, texel, 0).rg);
        return dot(normal, direction) < 0.0 ? sent_radiance(texel) : vec3(0.0);
    }
#ifdef WORLD
    return hit.hidden ? vec3(0.0) : environment_radiance(direction);
#else
    return vec3(0.0);
#endif
}

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy), pixel = gathered_pixel(texel);
    float view_depth = texelFetch(view_depth_layers, ivec3(pixel, layer), 0).r;
    vec3 sum = vec3(0.0);
    float squares = 0.0;
    int hits = 0;
    vec2 luminances = vec2(0.0); // from layers, from the world
    // Rays of empty texels are not sent: loops end where no texel has any left, branches are run anyway.
    int rays = isinf(view_depth) ? 0 : gather_rays;
    vec3 normal = decode_octahedral(texelFetch(normal_layers, ivec3(pixel, layer), 0).rg);
    vec3 origin = march_origin(relative_position(vec2(pixel) + 0.5, view_depth), normal, view_depth);
    for (int ray = 0; ray < rays; ++ray) {
        vec3 direction = cosine_direction(normal, ray_random(texel, ray, gather_rays));
        float jitter = fract(hash_to_unit(uvec2(texel)).x + gather_shift.x + float(ray) * 0.6180339887498949);
        MarchHit hit = deep_march(origin, direction, march_reach, march_steps, jitter);
        vec3 radiance = arriving_radiance(hit, direction);
        float brightness = luminance(radiance);
        sum += radiance;
        squares += brightness * brightness;
        hits += int(hit.hit);
        luminances += hit.hit ? vec2(brightness, 0.0) : vec2(0.0, brightness);
    }
    float share = 1.0 / float(max(rays, 1));
    out_irradiance = noisy_irradiance(sum * (PI * share), PI * mean_deviation(luminance(sum), squares, rays));
#if defined(DEBUG_MARCH_HITS)
    out_origin = vec4(vec3(float(hits) * share), 1.0);
#elif defined(DEBUG_LIGHT_ORIGIN)
    vec2 shares = luminances / max(luminances.x + luminances.y, 1e-30);
    out_origin = vec4(shares.x, 0.0, shares.y, 1.0);
#endif
}
