// SPDX-License-Identifier: GPL-3.0-or-later
// Specular reflection by the normalised model of Blinn and Phong, in place of ggx.glsl. Included by bsdf.glsl.

// Above it the exponent stays below 2e4, for which float32 has the power to 0.2 %.
const float SMALLEST_ALPHA = 1e-2;

/** Exponent whose highlight is as wide as that of GGX: Walter et al. 2007, section 5.2, of Beckmann's. */
float phong_exponent(float alpha)
{
    return 2.0 / (alpha * alpha) - 2.0;
}

/**
 * The surface of a G-buffer texel; see ggx.glsl. There is no Fresnel effect and no dependence on the view.
 *
 * The albedo is that for light along the normal, in closed form: Giesen 2009, "Phong Normalization Factor derivations".
 */
Surface make_surface(vec3 base_color, float f0, float metallic, float roughness, float diffuse_roughness, float n_dot_v)
{
    Surface surface;
    surface.metal_f0 = surface.metal_factor = vec3(0.0);
    surface.ior = 1.0;
    surface.dielectric_factor = 0.0;
#ifdef SPECULAR
    surface.alpha = max(roughness * roughness, SMALLEST_ALPHA);
    float n = phong_exponent(surface.alpha);
    surface.specular_f0 = mix(vec3(f0), base_color, metallic);
    surface.specular_albedo = surface.specular_f0 * ((n + 8.0) * (exp2(-0.5 * n) + n) / ((n + 2.0) * (n + 4.0)));
    surface.diffuse_albedo = base_color * ((1.0 - metallic) * (1.0 - f0));
#else
    surface.alpha = 1.0;
    surface.specular_f0 = surface.specular_albedo = vec3(0.0);
    surface.diffuse_albedo = base_color;
#endif
    return surface;
}

/** Blinn-Phong BRDF (n + 8)/(8π) (n·h)ⁿ times n·l. All vectors unit length, away from the surface. Unit: 1/sr. */
vec3 specular_brdf_cosine(Surface surface, vec3 normal, vec3 view, vec3 light)
{
    float n_dot_l = dot(normal, light);
    if (n_dot_l <= 0.0)
        return vec3(0.0);
    float n = phong_exponent(surface.alpha);
    float n_dot_h = clamp(dot(normal, normalize(view + light)), 0.0, 1.0);
    return surface.specular_f0 * ((n + 8.0) / (8.0 * PI) * pow(n_dot_h, n) * n_dot_l);
}
