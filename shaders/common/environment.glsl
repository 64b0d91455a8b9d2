// SPDX-License-Identifier: GPL-3.0-or-later
// The world's radiance by direction. Directions are unit vectors in world space; results are W/(sr·m²), or W/m² for
// irradiance. Uniforms: ENVIRONMENT_UNIFORMS in render/environment.py. ENVIRONMENT: there is a map; otherwise the world
// is environment_factor in all directions.

#include "common/constants.glsl"

#ifdef ENVIRONMENT
// Radiance by direction, equirectangular as EnvironmentMap says; mipmapped.
uniform sampler2D environment_map;
// Layer 0: irradiance by normal; 1…: GGX lobes of roughness α, each twice the one before. At the nodes of
// render/spherical_filter.py, so that neither the azimuth's seam nor the poles need care.
uniform sampler2DArray environment_blurs;

const float SMOOTHEST_BLUR = 0.05; // α of layer 1

/** Fractions 0…1 of the map's width and height. */
vec2 environment_place(vec3 direction)
{
    vec3 turned = mat3(environment_from_world) * direction;
    float horizontal = length(turned.xy);
    // At a pole every azimuth is right, but atan(0, 0) is undefined.
    float azimuth = horizontal > 0.0 ? atan(turned.y, turned.x) : 0.0;
    return vec2(0.5 - azimuth / (2.0 * PI), 0.5 + atan(turned.z, horizontal) / PI);
}

/** A blurred map at a place; its nodes lie at the centres of texels, the first and last at fractions 0 and 1. */
vec3 environment_blur(vec2 place, int layer)
{
    vec2 size = vec2(textureSize(environment_blurs, 0).xy);
    return textureLod(environment_blurs, vec3((place * (size - 1.0) + 0.5) / size, float(layer)), 0.0).rgb;
}
#endif

/** Radiance that arrives from a direction. Not filtered: no derivatives are taken, so the seam does not show. */
vec3 environment_radiance(vec3 direction)
{
#ifdef ENVIRONMENT
    return environment_factor.rgb * textureLod(environment_map, environment_place(direction), 0.0).rgb;
#else
    return environment_factor.rgb;
#endif
}

/** Irradiance on a surface with this normal that nothing shades. */
vec3 environment_irradiance(vec3 normal)
{
#ifdef ENVIRONMENT
    return environment_factor.rgb * environment_blur(environment_place(normal), 0);
#else
    return environment_factor.rgb * PI;
#endif
}

/**
 * Mean radiance in the lobe of a GGX surface of roughness α about the direction of mirror reflection; times the
 * surface's directional albedo it is the radiance that it reflects, as if seen along its normal (Karis 2013, "Real
 * Shading in Unreal Engine 4"). Lobes smoother than the first blurred map are interpolated between that and the map.
 */
vec3 environment_specular(vec3 reflected, float alpha)
{
#ifdef ENVIRONMENT
    vec2 place = environment_place(reflected);
    float level = log2(max(alpha, 1e-6) / SMOOTHEST_BLUR);
    if (level < 0.0) {
        // The lobe's half width is 2 α: the map is asked for texels as wide as that.
        float texel = min(PI / float(textureSize(environment_map, 0).x), 0.5 * SMOOTHEST_BLUR);
        float lod = max(log2(alpha / texel), 0.0);
        vec3 sharp = textureLod(environment_map, place, lod).rgb;
        return environment_factor.rgb * mix(sharp, environment_blur(place, 1), lod / log2(SMOOTHEST_BLUR / texel));
    }
    float last = float(textureSize(environment_blurs, 0).z - 2);
    float lower = min(floor(level), last - 1.0);
    vec3 smoother = environment_blur(place, 1 + int(lower));
    vec3 rougher = environment_blur(place, 2 + int(lower));
    return environment_factor.rgb * mix(smoother, rougher, min(level - lower, 1.0));
#else
    return environment_factor.rgb;
#endif
}
