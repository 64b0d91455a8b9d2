// SPDX-License-Identifier: GPL-3.0-or-later
// Lambert and GGX in the metallic/roughness parametrisation of Blender's Principled BSDF.

#include "common/constants.glsl"

// Cycles clamps roughness alike; below it the highlight of a light sample is narrower than float32 resolves.
const float SMALLEST_ALPHA = 1e-3;

struct Surface
{
    vec3 diffuse_albedo;    // share of incident light that leaves diffusely
    vec3 specular_f0;       // reflectance at normal incidence
    float alpha;            // GGX roughness, the square of the perceptual one
};

/**
 * Directional albedo of GGX with Schlick's Fresnel term, for unit light from everywhere.
 * Analytic fit of the split-sum tables: Karis 2014, "Physically Based Shading on Mobile".
 */
vec3 specular_albedo(vec3 f0, float roughness, float n_dot_v)
{
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * n_dot_v)) * r.x + r.y;
    vec2 scale_bias = vec2(-1.04, 1.04) * a + r.zw;
    // A surface without any specular reflectance has no Fresnel reflection either.
    return f0 * scale_bias.x + scale_bias.y * clamp(50.0 * f0, 0.0, 1.0);
}

/** The surface of a G-buffer texel: what the specular layer reflects is taken from the diffuse layer below it. */
Surface make_surface(vec3 base_color, float f0, float metallic, float roughness, float n_dot_v)
{
    Surface surface;
    surface.specular_f0 = mix(vec3(f0), base_color, metallic);
    vec3 dielectric = specular_albedo(vec3(f0), roughness, n_dot_v);
    surface.diffuse_albedo = base_color * (1.0 - metallic) * (1.0 - dielectric);
    surface.alpha = max(roughness * roughness, SMALLEST_ALPHA);
    return surface;
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
    vec3 fresnel = surface.specular_f0 + (clamp(50.0 * surface.specular_f0, 0.0, 1.0) - surface.specular_f0) * weight;
    return fresnel * distribution * 0.5 / (masking + shadowing) * n_dot_l;
}
