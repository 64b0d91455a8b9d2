// SPDX-License-Identifier: GPL-3.0-or-later
// What a surface reflects: its diffuse part, and by ggx.glsl or with PHONG by phong.glsl its specular one, which also
// make the surface.

#include "common/constants.glsl"

#ifdef PHONG
#undef DIFFUSE_ROUGHNESS // Phong's diffuse reflection is Lambert's
#endif

struct Surface
{
    vec3 diffuse_albedo;    // share of incident light that leaves diffusely, for a Lambertian surface
    vec3 specular_albedo;   // share that is reflected specularly, for unit light from everywhere
    vec3 specular_f0;       // reflectance at normal incidence, 0 without specular reflection
    vec3 metal_f0;
    vec3 metal_factor;      // share of metal, times what returns the light that single scattering loses
    float ior;              // of the dielectric
    float dielectric_factor;
    float alpha;            // GGX roughness, the square of the perceptual one
#ifdef DIFFUSE_ROUGHNESS
    float diffuse_roughness;
    vec3 diffuse_multiple;  // albedo of the light that leaves a rough diffuse surface after scattering on it repeatedly
#endif
};

/** Share of unit light from everywhere that Fujii's Oren-Nayar surface reflects by scattering once, in closed form. */
float rough_diffuse_albedo(float cosine, float roughness)
{
    float c = clamp(cosine, 1e-4, 1.0);
    float s = sqrt(1.0 - c * c);
    float g = s * (acos(c) - s * c) + 2.0 / 3.0 * (s / c * (1.0 - s * s * s) - s);
    return (1.0 + roughness * g / PI) / (1.0 + (0.5 - 2.0 / (3.0 * PI)) * roughness);
}

/** Hemispherical mean of `rough_diffuse_albedo`. */
float mean_rough_diffuse_albedo(float roughness)
{
    return (1.0 + (2.0 / 3.0 - 28.0 / (15.0 * PI)) * roughness) / (1.0 + (0.5 - 2.0 / (3.0 * PI)) * roughness);
}

#ifdef DIFFUSE_ROUGHNESS
/** Give a surface whose other fields are known its diffuse roughness, for views of this n·v. */
void set_diffuse_roughness(inout Surface surface, vec3 base_color, float diffuse_roughness, float n_dot_v)
{
    // Cycles takes the square of the colour where EON has the colour: what scatters repeatedly is more saturated.
    float mean = mean_rough_diffuse_albedo(diffuse_roughness);
    vec3 color = clamp(base_color, 0.0, 1.0);
    surface.diffuse_roughness = diffuse_roughness;
    surface.diffuse_multiple = surface.diffuse_albedo * color * color * mean / (1.0 - color * (1.0 - mean))
                               * (1.0 - rough_diffuse_albedo(n_dot_v, diffuse_roughness))
                               / max(1.0 - mean, FLOAT_EPSILON);
}
#endif

/** Share of unit light from everywhere that leaves diffusely. `n_dot_v`: of the view that the surface was made for. */
vec3 diffuse_directional_albedo(Surface surface, float n_dot_v)
{
#ifdef DIFFUSE_ROUGHNESS
    return surface.diffuse_albedo * rough_diffuse_albedo(n_dot_v, surface.diffuse_roughness)
           + surface.diffuse_multiple * (1.0 - mean_rough_diffuse_albedo(surface.diffuse_roughness));
#else
    return surface.diffuse_albedo;
#endif
}

/**
 * Diffuse BRDF times n·l: Lambert's, or with DIFFUSE_ROUGHNESS the energy-preserving Oren-Nayar model of Portsmouth,
 * Kutz and Hill 2024 ("EON", JCGT 14(1)) over Fujii's. All vectors unit length, away from the surface. Unit: 1/sr.
 */
vec3 diffuse_brdf_cosine(Surface surface, vec3 normal, vec3 view, vec3 light)
{
    float n_dot_l = max(dot(normal, light), 0.0);
#ifdef DIFFUSE_ROUGHNESS
    float roughness = surface.diffuse_roughness;
    float n_dot_v = max(dot(normal, view), 0.0);
    float s = dot(light, view) - n_dot_l * n_dot_v;
    if (s > 0.0)
        s /= max(max(n_dot_l, n_dot_v), FLOAT_EPSILON);
    float once = (1.0 + roughness * s) / (1.0 + (0.5 - 2.0 / (3.0 * PI)) * roughness);
    vec3 repeatedly = surface.diffuse_multiple * (1.0 - rough_diffuse_albedo(n_dot_l, roughness));
    return (surface.diffuse_albedo * once + repeatedly) * (n_dot_l / PI);
#else
    return surface.diffuse_albedo * (n_dot_l / PI);
#endif
}

#ifdef PHONG
#include "common/phong.glsl"
#else
#include "common/ggx.glsl"
#endif
