// SPDX-License-Identifier: GPL-3.0-or-later
// Lambert and GGX in the metallic/roughness parametrisation of Blender's Principled BSDF.

#include "common/constants.glsl"

// Cycles clamps roughness alike; below it the highlight of a light sample is narrower than float32 resolves.
const float SMALLEST_ALPHA = 1e-3;

// (roughness, n·v) -> scale and bias of F0 and F90 in the directional albedo; render/ggx_albedo.py integrates it.
uniform sampler2D ggx_albedo_table;

/** Scale of F0 and bias for F90; the table's nodes are the centres of its texels. */
vec2 lookup_ggx_albedo(float roughness, float n_dot_v)
{
    vec2 size = vec2(textureSize(ggx_albedo_table, 0));
    return textureLod(ggx_albedo_table, (vec2(roughness, n_dot_v) * (size - 1.0) + 0.5) / size, 0.0).rg;
}

struct Surface
{
    vec3 diffuse_albedo;    // share of incident light that leaves diffusely
    vec3 specular_albedo;   // share that is reflected specularly, for unit light from everywhere
    vec3 specular_f0;       // reflectance at normal incidence
    vec3 multiple_scattering; // factor that returns what single scattering between microfacets loses
    float alpha;            // GGX roughness, the square of the perceptual one
};

/** Reflectance at grazing incidence: 1, but nothing where there is no specular layer at all. */
vec3 grazing_reflectance(vec3 f0)
{
    return clamp(50.0 * f0, 0.0, 1.0);
}

/**
 * Factor on single-scattering GGX that makes a white metal reflect everything.
 * Turquin 2019, "Practical multiple scattering compensation for microfacet models", eq. 16; `albedo` from the table.
 */
vec3 multiple_scattering_factor(vec3 f0, vec2 albedo)
{
    float single = albedo.x + albedo.y;
    return 1.0 + f0 * (1.0 - single) / single;
}

/** Share of light from everywhere that GGX reflects, multiple scattering included. */
vec3 directional_albedo(vec3 f0, vec2 albedo)
{
    return (f0 * albedo.x + grazing_reflectance(f0) * albedo.y) * multiple_scattering_factor(f0, albedo);
}

/** The surface of a G-buffer texel: what the dielectric layer reflects is taken from the diffuse one below it. */
Surface make_surface(vec3 base_color, float f0, float metallic, float roughness, float n_dot_v)
{
#ifdef SPECULAR
    vec2 albedo = lookup_ggx_albedo(roughness, n_dot_v);
    Surface surface;
    surface.specular_f0 = mix(vec3(f0), base_color, metallic);
    surface.diffuse_albedo = base_color * (1.0 - metallic) * (1.0 - directional_albedo(vec3(f0), albedo));
    surface.specular_albedo = directional_albedo(surface.specular_f0, albedo);
    surface.multiple_scattering = multiple_scattering_factor(surface.specular_f0, albedo);
    surface.alpha = max(roughness * roughness, SMALLEST_ALPHA);
    return surface;
#else
    return Surface(base_color, vec3(0.0), vec3(0.0), vec3(1.0), 1.0);
#endif
}

/**
 * GGX BRDF times n·l: Walter et al. 2007 (distribution), Heitz 2014 eq. 99 (height-correlated masking and shadowing),
 * Schlick 1994 (Fresnel). All vectors unit length, away from the surface. Unit: 1/sr.
 */
vec3 specular_brdf_cosine(Surface surface, vec3 normal, vec3 view, vec3 light)
{
    float n_dot_l = dot(normal, light);
    if (n_dot_l <= 0.0)
        return vec3(0.0);
    vec3 halfway = normalize(view + light);
    float n_dot_v = max(dot(normal, view), 1e-4);
    float n_dot_h = clamp(dot(normal, halfway), 0.0, 1.0);
    float a2 = surface.alpha * surface.alpha;
    // (n·h)²(a² − 1) + 1, written so that it keeps its digits near n·h = 1.
    float denominator = (1.0 - n_dot_h) * (1.0 + n_dot_h) + a2 * n_dot_h * n_dot_h;
    float distribution = a2 / (PI * denominator * denominator);
    float masking = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2);
    float shadowing = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2);
    float weight = pow(1.0 - clamp(dot(light, halfway), 0.0, 1.0), 5.0);
    vec3 fresnel = mix(surface.specular_f0, grazing_reflectance(surface.specular_f0), weight);
    return surface.multiple_scattering * fresnel * distribution * 0.5 / (masking + shadowing) * n_dot_l;
}
