// SPDX-License-Identifier: GPL-3.0-or-later
// What layers send that has not reached other surfaces as direct light already.

#ifdef RADIANCE
uniform sampler2DArray radiance_layers; // outgoing, of the direct pass
#endif
#ifdef SAMPLED_EMISSION
#include "common/shared_exponent.glsl"
uniform sampler2DArray emission_layers;
#endif

/**
 * Radiance (W/(sr·m²)) that a texel's surface sends on; RADIANCE: something lights it. SAMPLED_EMISSION: emissive
 * surfaces are sampled as lights, and what they emit counts as direct light.
 */
vec3 shaded_radiance(ivec3 texel)
{
    vec3 radiance = vec3(0.0);
#ifdef RADIANCE
    radiance = texelFetch(radiance_layers, texel, 0).rgb;
#endif
#ifdef SAMPLED_EMISSION
    radiance = max(radiance - decode_shared_exponent(texelFetch(emission_layers, texel, 0)), 0.0);
#endif
    return radiance;
}
