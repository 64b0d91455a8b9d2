// SPDX-License-Identifier: GPL-3.0-or-later
// What a surface reflects of lamps, emissive surfaces and the world past what is in between. With PREVIEW lamps are
// shown whole, by closed forms and soft shadows; else by one point each.

#include "common/bsdf.glsl"
#include "generated/DirectUniforms.glsl"

// Closed forms know GGX; with Phong's highlights a preview shows lamps by their centres.
#if defined(PREVIEW) && !defined(PHONG)
#define WHOLE_LAMPS
#endif

#ifdef LIGHTS
#include "common/lights.glsl"
#ifdef WHOLE_LAMPS
#include "common/analytic_lights.glsl"
#endif
#ifdef SHADOWS
#include "common/shadows.glsl"
#endif
#ifdef MANY_LIGHTS
#include "common/light_reach.glsl"
#include "common/light_tiles.glsl"
#endif
#endif
#ifdef WORLD
#include "common/environment.glsl"
#endif

/** Radiance that leaves by diffuse and by specular reflection. */
struct Reflected
{
    vec3 diffuse;
    vec3 glossy;
};

/** What is lit in a texel. */
struct Shading
{
    Surface surface;
    vec3 position;
    vec3 normal;
    vec3 view;
    float precision_along_view; // m by which the position may be off
    int link_group;
    vec2 random;                // another in every pixel and sample
    Surface world_surface;      // as rough as the world's samples need it
    vec3 world_sharpness;       // what the surface reflects of the world over what that one does
};

#ifdef LIGHTS
#ifdef SPECULAR
/** A light's point moved a little at random, by about the distance to its other samples' points. */
LightPoint scattered(Light light, LightPoint point, vec2 random)
{
    LightPoint moved = point;
    vec2 offset = highlight_jitter * (2.0 * random - 1.0);
#ifdef MESH_LIGHTS
    if (light.kind == LIGHT_MESH) {
        // On the plane through the point, as if the surface were a square of the same area.
        vec3 tangent, bitangent;
        orthonormal_basis(point.normal, tangent, bitangent);
        moved.offset += 0.5 * sqrt(light.radius) * (offset.x * tangent + offset.y * bitangent);
        return moved;
    }
#endif
    if (light.kind == LIGHT_AREA && !light.ellipse) {
        vec2 place = point.offset.xy + offset;
        moved.offset.xy = clamp(place, -2.0 - place, 2.0 - place); // folded back at the edges
        return moved;
    }
    vec3 tangent = vec3(1.0, 0.0, 0.0), bitangent = vec3(0.0, 1.0, 0.0);
    if (light.kind != LIGHT_AREA)
        orthonormal_basis(light.axis, tangent, bitangent);
    moved.offset += offset.x * tangent + offset.y * bitangent;
    moved.offset /= max(length(moved.offset), 1.0);
    return moved;
}
#endif

#ifdef WHOLE_LAMPS
/** A lamp as a whole. */
Reflected lit_by_lamp(int index, Light light, LightPoint point, Shading shading)
{
    Reflected result = Reflected(analytic_diffuse(light, shading.surface, shading.position, shading.normal, shading.view)
                                     * light.diffuse_factor,
                                 vec3(0.0));
#ifdef SPECULAR
    result.glossy = analytic_specular(light, shading.surface, shading.position, shading.normal, shading.view)
                    * light.specular_factor;
#endif
#ifdef MANY_LIGHTS
    vec3 to_light = light.position - shading.position;
    float share = light_reach_weight(index, dot(to_light, to_light));
    result.diffuse *= share;
    result.glossy *= share;
#endif
#ifdef SHADOWS
    if (point.shadow_count != 0) {
        vec3 origin = light_origin(light, point);
        bool distant = light.kind == LIGHT_SUN;
        vec3 direction = distant ? -light.axis : normalize(origin - shading.position);
        Receiver receiver = Receiver(shading.position, shading.normal, shading.precision_along_view);
        float visibility = soft_visibility(point, origin, light_radius(light), receiver,
                                           dot(shading.normal, direction), 2.0 * PI * shading.random.x);
        result.diffuse *= visibility;
        result.glossy *= visibility;
    }
#endif
    return result;
}
#endif

/** A light by its sampled point. */
Reflected lit_by_point(int index, Light light, LightPoint point, Shading shading)
{
    LightSample incident = sample_light(light, shading.position, point);
    float n_dot_l = dot(shading.normal, incident.direction);
    vec3 weight = incident.weight;
#ifdef MANY_LIGHTS
    vec3 to_light = light.position - shading.position;
    weight *= light_reach_weight(index, dot(to_light, to_light));
#endif
#ifdef SHADOWS
    if (point.shadow_count != 0 && n_dot_l > 0.0 && weight != vec3(0.0)) {
        Receiver receiver = Receiver(shading.position, shading.normal, shading.precision_along_view);
        weight *= point_visibility(point, light_origin(light, point), receiver, n_dot_l);
    }
#endif
    Reflected result;
    result.diffuse = diffuse_brdf_cosine(shading.surface, shading.normal, shading.view, incident.direction) * weight
                     * light.diffuse_factor;
    result.glossy = vec3(0.0);
#ifdef SPECULAR
    if (any(greaterThan(shading.surface.specular_f0, vec3(0.0)))) {
        // Highlights take another point near the sampled one in every pixel: a shared one would show as a dot.
        LightSample reflected = sample_light(light, shading.position, scattered(light, point, shading.random));
        // Whatever is in between the sampled point is in between this one as well.
        vec3 arriving = weight * (reflected.weight / max(incident.weight, vec3(1e-37)));
        arriving *= light.specular_factor;
        bool world = light.kind == LIGHT_WORLD;
        result.glossy = specular_brdf_cosine(world ? shading.world_surface : shading.surface, shading.normal,
                                             shading.view, reflected.direction)
                        * arriving * (world ? shading.world_sharpness : vec3(1.0));
    }
#endif
    return result;
}

/** Adds what one light causes. */
void add_light(int index, Shading shading, inout Reflected sum)
{
#ifdef LINKING
    if (!lights_group(index, shading.link_group))
        return;
#endif
    Light light = fetch_light(index);
    LightPoint point = fetch_light_point(index);
#if defined(WHOLE_LAMPS) && defined(MESH_LIGHTS)
    Reflected reflected;
    if (light.kind == LIGHT_MESH)
        reflected = lit_by_point(index, light, point, shading);
    else
        reflected = lit_by_lamp(index, light, point, shading);
#elif defined(WHOLE_LAMPS)
    Reflected reflected = lit_by_lamp(index, light, point, shading);
#else
    Reflected reflected = lit_by_point(index, light, point, shading);
#endif
    sum.diffuse += reflected.diffuse;
    sum.glossy += reflected.glossy;
}

/** What all lights cause. */
Reflected lit_by_lights(Shading shading)
{
    Reflected sum = Reflected(vec3(0.0), vec3(0.0));
#ifdef MANY_LIGHTS
    for (int page = 0; page < light_tile_pages; ++page) {
        uvec4 words = light_tile_page(ivec2(gl_FragCoord.xy), layer, light_tile_pages, page);
        for (int word = 0; word < 4; ++word)
            for (uint left = words[word]; left != 0u; left &= left - 1u)
                add_light(light_tile_index(page, word, left), shading, sum);
    }
#else
    for (int index = 0; index < light_count; ++index)
        add_light(index, shading, sum);
#endif
    return sum;
}
#endif

#if defined(WORLD) && defined(PREVIEW)
/** What the world causes where nothing is in between. */
Reflected lit_by_world(Shading shading)
{
    float n_dot_v = clamp(dot(shading.normal, shading.view), 0.0, 1.0);
    vec3 mirrored = reflect(-shading.view, shading.normal);
    return Reflected(environment_irradiance(shading.normal) / PI
                         * diffuse_directional_albedo(shading.surface, n_dot_v) * world_factors.x,
                     environment_specular(mirrored, shading.surface.alpha) * shading.surface.specular_albedo
                         * world_factors.y);
}
#endif

/** Roughness of a surface for the world's samples, which fall too far apart for the reflections of smoother ones. */
float world_roughness(float roughness)
{
#ifdef WORLD_LIGHTS
    return max(roughness, sqrt(smallest_world_alpha));
#else
    return roughness;
#endif
}

/**
 * What a surface reflects of the world where nothing is in between, over what the rougher one does.
 *
 * By that one the samples tell what is in between; the ratio gives back what it blurs, and tends to 1 with more samples.
 */
vec3 world_sharpness(Shading shading)
{
    vec3 ratio = vec3(1.0);
#ifdef WORLD_LIGHTS
    if (shading.surface.alpha < shading.world_surface.alpha) {
        ratio = shading.surface.specular_albedo / max(shading.world_surface.specular_albedo, vec3(1e-6));
#if defined(WORLD) && defined(ENVIRONMENT)
        vec3 mirrored = reflect(-shading.view, shading.normal);
        ratio *= environment_specular(mirrored, shading.surface.alpha)
                 / max(environment_specular(mirrored, shading.world_surface.alpha), vec3(1e-20));
#endif
    }
#endif
    return ratio;
}

/** What all of it causes. */
Reflected lit(Shading shading)
{
    Reflected sum = Reflected(vec3(0.0), vec3(0.0));
    shading.world_sharpness = world_sharpness(shading);
#ifdef LIGHTS
    sum = lit_by_lights(shading);
#endif
#if defined(WORLD) && defined(PREVIEW)
    Reflected world = lit_by_world(shading);
    sum.diffuse += world.diffuse;
    sum.glossy += world.glossy;
#endif
    return sum;
}
