// SPDX-License-Identifier: GPL-3.0-or-later
// One iteration of an à-trous filter over the texels of one surface (Dammertz et al. 2010, "Edge-Avoiding À-Trous
// Wavelet Transform for fast Global Illumination Filtering"), weighted by how far luminances differ in terms of their
// noise (Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering").

#include "common/luminance.glsl"
#include "filter/surfaces.glsl"

uniform sampler2DArray unfiltered;

layout(location = 0) out vec4 out_irradiance; // W/m², variance of its luminance

// Standard deviations of the difference of two texels from which on it is one of irradiance, not of noise.
const float NOISE = 3.0;
// Below any variance, so that texels without noise are mixed where they are equal.
const float SMALLEST = 1e-37;

/**
 * 0…1: whether two irradiances (variance of the luminance in a) may differ by nothing but noise.
 *
 * The difference's own variance is the sum of theirs. A weight that both sides agree on does not darken: one by the
 * centre's variance alone would, where noise is many small values and few large ones.
 */
float luminance_weight(vec4 first, vec4 second)
{
    float difference = luminance(first.rgb) - luminance(second.rgb);
    float deviation = NOISE * sqrt(first.a + second.a) + SMALLEST;
    return max(1.0 - (difference / deviation) * (difference / deviation), 0.0);
}

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy), last = textureSize(unfiltered, 0).xy - 1;
    Seen seen = seen_by(texel);
    out_irradiance = vec4(0.0);
    if (seen.view_depth == 0.0)
        return;
    SurfacePlane plane = plane_of(seen);
    float tolerance = tolerance_at(seen.view_depth);
    vec4 centre = texelFetch(unfiltered, ivec3(texel, 0), 0), sum = centre;
    float total = 1.0;
    for (int i = 0; i < 9; i++) {
        ivec2 offset = ivec2(i % 3, i / 3) - 1, other = texel + offset * stride;
        if (i == 4 || any(lessThan(other, ivec2(0))) || any(greaterThan(other, last)))
            continue;
        vec4 value = texelFetch(unfiltered, ivec3(other, 0), 0);
        float kernel = offset.x * offset.y == 0 ? 0.5 : 0.25;
        float weight = neighbour_share * kernel * same_surface(seen, plane, tolerance, seen_by(other))
            * luminance_weight(centre, value);
        if (weight > 0.0) { // a texel without weight may hold anything
            sum += vec4(weight * value.rgb, weight * weight * value.a);
            total += weight;
        }
    }
    // Variances add up with the squares of the weights.
    out_irradiance = sum / vec2(total, total * total).xxxy;
}
