// SPDX-License-Identifier: GPL-3.0-or-later
// Specular reflection of Blender's Principled BSDF as Cycles evaluates it: a GGX metal, or a GGX dielectric over a diffuse
// surface that gets what the dielectric lets through. Included by bsdf.glsl.

// Cycles clamps roughness alike; below it the highlight of a light sample is narrower than float32 resolves.
const float SMALLEST_ALPHA = 1e-3;
// √F0 above which a dielectric's index of refraction is no longer followed; 0.98 of the light is reflected there.
const float LARGEST_ROOT = 0.99;

#ifdef SPECULAR
// (roughness, n·v, √F0) -> parts of the directional albedo; render/ggx_albedo.py integrates it.
uniform sampler3D ggx_albedo_table;

struct GgxAlbedo
{
    float single;           // share reflected by scattering once, where every reflection is complete
    float schlick;          // what of it Schlick's weight (1 - cosθ)⁵ takes
    float dielectric;       // mean place of a dielectric's reflectance between F0 and 1
    float mean;             // `single`, averaged over the hemisphere
};

/** The table's nodes are the centres of its texels. `root`: √F0. */
GgxAlbedo lookup_ggx_albedo(float roughness, float n_dot_v, float root)
{
    vec3 size = vec3(textureSize(ggx_albedo_table, 0));
    vec4 entry = textureLod(ggx_albedo_table, (vec3(roughness, n_dot_v, root) * (size - 1.0) + 0.5) / size, 0.0);
    return GgxAlbedo(entry.r, entry.g, entry.b, entry.a);
}
#endif

/** Unpolarised reflectance of a smooth dielectric for light from air. */
float dielectric_fresnel(float cosine, float ior)
{
    float c = max(cosine, 1e-6);
    float g = sqrt(ior * ior - 1.0 + c * c);
    float across = (c - g) / (c + g);
    float along = (ior * ior * c - g) / (ior * ior * c + g);
    return 0.5 * (across * across + along * along);
}

/** Schlick's approximation (1994) of a metal's reflectance. */
vec3 metal_fresnel(float cosine, vec3 f0)
{
    return mix(f0, vec3(1.0), pow(1.0 - clamp(cosine, 0.0, 1.0), 5.0));
}

#ifdef SPECULAR
/**
 * Factor on single-scattering GGX for the light that is reflected repeatedly between microfacets.
 *
 * Turquin 2019, "Practical multiple scattering compensation for microfacet models", with the reflectance of Kulla and
 * Conty 2017, "Revisiting Physically Based Shading at Imageworks". `reflectance`: hemispherical mean of Fresnel's.
 */
vec3 multiple_scattering_factor(vec3 reflectance, GgxAlbedo albedo)
{
    vec3 repeated = reflectance * albedo.mean / (1.0 - reflectance * (1.0 - albedo.mean));
    return 1.0 + repeated * (1.0 - albedo.single) / albedo.single;
}
#endif

/**
 * The surface of a G-buffer texel. `f0`: the dielectric's reflectance at normal incidence, 0 where there is none;
 * `roughness` perceptual; `diffuse_roughness` 0…1 of what lies below, read with DIFFUSE_ROUGHNESS only.
 */
Surface make_surface(vec3 base_color, float f0, float metallic, float roughness, float diffuse_roughness, float n_dot_v)
{
    Surface surface;
#ifdef SPECULAR
    float root = min(sqrt(f0), LARGEST_ROOT);
    float dielectric = f0 > 0.0 ? 1.0 - metallic : 0.0;
    GgxAlbedo albedo = lookup_ggx_albedo(roughness, n_dot_v, root);
    surface.ior = (1.0 + root) / (1.0 - root);
    // Hemispherical mean of Fresnel's reflectance: of a dielectric by Kulla and Conty 2017, of Schlick's exactly.
    float mean_reflectance = (surface.ior - 1.0) / (4.08567 + 1.00071 * surface.ior);
    float scattering = multiple_scattering_factor(vec3(mean_reflectance), albedo).x;
    float reflected = f0 > 0.0 ? mix(root * root, 1.0, albedo.dielectric) * albedo.single * scattering : 0.0;
    surface.metal_f0 = base_color;
    surface.metal_factor = metallic * multiple_scattering_factor(mix(base_color, vec3(1.0), 1.0 / 21.0), albedo);
    surface.dielectric_factor = dielectric * scattering;
    surface.specular_f0 = metallic * base_color + dielectric * f0;
    surface.specular_albedo = mix(base_color * albedo.single, vec3(albedo.single), albedo.schlick / albedo.single)
                                  * surface.metal_factor
                              + (1.0 - metallic) * reflected;
    surface.diffuse_albedo = base_color * (1.0 - metallic) * (1.0 - reflected);
    surface.alpha = max(roughness * roughness, SMALLEST_ALPHA);
#else
    surface.diffuse_albedo = base_color;
    surface.specular_albedo = surface.specular_f0 = surface.metal_f0 = surface.metal_factor = vec3(0.0);
    surface.ior = surface.alpha = 1.0;
    surface.dielectric_factor = 0.0;
#endif
#ifdef DIFFUSE_ROUGHNESS
    set_diffuse_roughness(surface, base_color, diffuse_roughness, n_dot_v);
#endif
    return surface;
}

/**
 * GGX BRDF times n·l: Walter et al. 2007 (distribution), Heitz 2014 eq. 99 (height-correlated masking and shadowing).
 * All vectors unit length, away from the surface. Unit: 1/sr.
 */
vec3 specular_brdf_cosine(Surface surface, vec3 normal, vec3 view, vec3 light)
{
    float n_dot_l = dot(normal, light);
    if (n_dot_l <= 0.0)
        return vec3(0.0);
    vec3 halfway = normalize(view + light);
    float n_dot_v = max(dot(normal, view), 1e-4);
    float n_dot_h = clamp(dot(normal, halfway), 0.0, 1.0);
    float l_dot_h = dot(light, halfway);
    float a2 = surface.alpha * surface.alpha;
    // (n·h)²(a² − 1) + 1, written so that it keeps its digits near n·h = 1.
    float denominator = (1.0 - n_dot_h) * (1.0 + n_dot_h) + a2 * n_dot_h * n_dot_h;
    float distribution = a2 / (PI * denominator * denominator);
    float masking = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2);
    float shadowing = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2);
    vec3 reflectance = surface.metal_factor * metal_fresnel(l_dot_h, surface.metal_f0)
                       + surface.dielectric_factor * dielectric_fresnel(l_dot_h, surface.ior);
    return reflectance * (distribution * 0.5 / (masking + shadowing) * n_dot_l);
}
