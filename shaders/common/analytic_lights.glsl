// SPDX-License-Identifier: GPL-3.0-or-later
// Light of whole lamps at a point, unshadowed and without sampling: what a preview of one sample shows.

#include "common/bsdf.glsl"
#include "common/lights.glsl"
#include "common/ltc.glsl"

// Sine below which a cone counts as one direction.
const float SMALLEST_CONE = 1e-6;
// Angular size below which an area light counts as one direction: the error of that is of second order.
const float SMALLEST_ANGLE = 0.01;
// Angular size over GGX's α, half the width of its lobe: up to the first, a highlight is that of the light's centre, and
// from the second on the whole light's.
const vec2 POINT_TO_SOLID = vec2(0.03, 0.1);

// n·l of a light's centre below which a rough diffuse surface is taken for a Lambertian one.
const float LOWEST_CENTER = 1e-3;

/** A cone of directions in which radiance is uniform. */
struct LightCone
{
    vec3 direction;         // unit, from the surface
    float sine;             // of the half angle, at most a right one
    vec3 irradiance;        // of a surface that faces it, W/m²
};

/** Share of light that a point or spot light sends in a direction away from it. */
float spot_factor(Light light, vec3 direction)
{
#ifdef SPOT_CONES
    if (light.kind == LIGHT_SPOT)
        return smoothstep(0.0, 1.0, (dot(direction, light.axis) - light.cone_cosine) / light.cone_softness);
#endif
    return 1.0;
}

/** The cone that a point, spot or sun light fills as seen from `position`; dark at the light's very centre. */
LightCone light_cone(Light light, vec3 position)
{
#ifdef SUN_LIGHTS
    if (light.kind == LIGHT_SUN)
        return LightCone(-light.axis, sin(light.radius), light.emission);
#endif
    vec3 to_light = light.position - position;
    float distance_squared = dot(to_light, to_light);
    if (distance_squared == 0.0)
        return LightCone(-light.axis, 0.0, vec3(0.0));
    vec3 direction = to_light * inversesqrt(distance_squared);
    float radius_squared = light.radius * light.radius;
    // A facing disk is seen under the tangent radius / distance, a sphere under that sine.
    float outer = light.spread_slope > 0.0 ? distance_squared + radius_squared : max(distance_squared, radius_squared);
    return LightCone(direction, min(light.radius * inversesqrt(outer), 1.0),
                     light.emission * (spot_factor(light, -direction) / outer));
}

/** (1 + x²) atan(z) - x² z with z = y/x, x and y not negative, of which small z leave no digits. */
float segment_term(float x, float y)
{
    if (y > 0.4 * x)
        return (1.0 + x * x) * atan(y, x) - x * y;
    float z = y / x;
    float square = z * z;
    float defect = 1.0 / 3.0 - square * (1.0 / 5.0 - square * (1.0 / 7.0 - square / 9.0));
    return z - (1.0 + x * x) * z * square * defect; // z - atan(z) = z³ defect
}

/**
 * Irradiance of a surface by a cone of uniform radiance, over that of one that faces it.
 *
 * Exact with the part below the horizon cut off: configuration factor of a sphere to a tilted planar element (Naraghi
 * and Chung 1982), a sphere and a cone being the same directions, its terms arranged so that narrow cones keep their
 * digits. `cosine`: of the angle between normal and axis, `sine`: of the half angle.
 */
float cone_cosine_factor(float cosine, float sine)
{
    if (cosine >= sine || sine < SMALLEST_CONE)
        return max(cosine, 0.0);
    if (cosine <= -sine)
        return 0.0;
    float tilt_sine = sqrt(1.0 - cosine * cosine);
    float x = sqrt(1.0 - sine * sine) / sine;
    float y = clamp(-x * cosine / tilt_sine, -1.0, 1.0);
    return (cosine * acos(y) + segment_term(x, tilt_sine * sqrt(1.0 - y * y))) / PI;
}

#ifdef AREA_LIGHTS
/** Whether the light has a front that faces a point, `center` being the light's as seen from there. */
bool shines_on(Light light, vec3 center)
{
    return dot(center, light.axis) < 0.0 && light_area(light) > 0.0;
}

/** Irradiance of a facing surface by a small light of which every part is seen as its centre. */
vec3 small_area_irradiance(Light light, vec3 center)
{
    float distance_squared = dot(center, center);
    float cosine = -dot(center, light.axis) * inversesqrt(distance_squared);
    return light.emission * (spread_factor(light, cosine) * light_area(light) * cosine / distance_squared);
}

/** Largest half axis over the distance. */
float angular_size(Light light, vec3 center)
{
    return sqrt(max(dot(light.half_x, light.half_x), dot(light.half_y, light.half_y)) / dot(center, center));
}

Polygon light_polygon(Light light, vec3 center)
{
    return light.ellipse ? ellipse_polygon(center, light.half_x, light.half_y)
                         : rectangle_polygon(center, light.half_x, light.half_y);
}

/**
 * What of a light its spread lets shine here: the rectangle around it, and the mean of the spread factor over that.
 *
 * Approximate: the mean is that of 8x8 points, and an ellipse's rim is blurred over the distance between two of them.
 */
float spread_part(Light light, vec3 center, vec3 normal, out Polygon part)
{
    const int POINTS = 8;
    vec2 half_size = vec2(length(light.half_x), length(light.half_y));
    vec2 foot = -vec2(dot(center, light.half_x), dot(center, light.half_y)) / (half_size * half_size);
    vec2 reach = -dot(center, light.axis) * light.spread_slope / half_size;
    vec2 low = clamp(foot - reach, -1.0, 1.0), high = clamp(foot + reach, -1.0, 1.0);
    vec2 middle = 0.5 * (low + high);
    part = rectangle_polygon(center + middle.x * light.half_x + middle.y * light.half_y,
                             0.5 * (high.x - low.x) * light.half_x, 0.5 * (high.y - low.y) * light.half_y);
    vec2 step_size = (high - low) / float(POINTS);
    float received = 0.0;
    float spread = 0.0;
    for (int index = 0; index < POINTS * POINTS; ++index) {
        vec2 place = low + (vec2(index % POINTS, index / POINTS) + 0.5) * step_size;
        vec3 to_light = center + place.x * light.half_x + place.y * light.half_y;
        float distance_squared = dot(to_light, to_light);
        float cosine = -dot(to_light, light.axis) * inversesqrt(distance_squared);
        float weight = max(dot(normal, to_light), 0.0) * cosine / (distance_squared * sqrt(distance_squared));
        float inside = (1.0 - length(place)) / max(0.5 * (step_size.x + step_size.y), FLOAT_EPSILON) + 0.5;
        received += weight;
        spread += weight * spread_factor(light, cosine) * (light.ellipse ? clamp(inside, 0.0, 1.0) : 1.0);
    }
    return received > 0.0 ? spread / received : 0.0;
}

vec3 area_irradiance(Light light, vec3 center, vec3 normal)
{
    if (!shines_on(light, center))
        return vec3(0.0);
    if (angular_size(light, center) < SMALLEST_ANGLE)
        return small_area_irradiance(light, center) * max(dot(normal, normalize(center)), 0.0);
    Polygon polygon = light_polygon(light, center);
    float spread = 1.0;
    if (light.spread_norm > 0.0)
        spread = spread_part(light, center, normal, polygon);
    vec3 tangent, bitangent;
    orthonormal_basis(normal, tangent, bitangent);
    mat3 local = transpose(mat3(tangent, bitangent, normal));
    return light.emission * (PI * spread * cosine_lobe_over(transformed(local, polygon), vec3(0.0, 0.0, 1.0)).z);
}
#endif

/** Unshadowed irradiance (W/m²) by a point, spot, sun or area light; a spot's edge is taken at the light's centre. */
vec3 analytic_irradiance(Light light, vec3 position, vec3 normal)
{
#ifdef AREA_LIGHTS
    if (light.kind == LIGHT_AREA)
        return area_irradiance(light, light.position - position, normal);
#endif
    LightCone cone = light_cone(light, position);
    return cone.irradiance * cone_cosine_factor(dot(normal, cone.direction), cone.sine);
}

/**
 * Radiance that the surface reflects diffusely of such a light, unshadowed: exact for a Lambertian surface; a rough one
 * reflects as it does what comes from the light's centre.
 */
vec3 analytic_diffuse(Light light, Surface surface, vec3 position, vec3 normal, vec3 view)
{
    vec3 irradiance = analytic_irradiance(light, position, normal);
#ifdef DIFFUSE_ROUGHNESS
    vec3 direction = light.kind == LIGHT_SUN ? -light.axis : light.position - position;
    float squared = dot(direction, direction);
    float n_dot_l = squared > 0.0 ? dot(normal, direction) * inversesqrt(squared) : 0.0;
    if (n_dot_l > LOWEST_CENTER)
        return irradiance * diffuse_brdf_cosine(surface, normal, view, direction * inversesqrt(squared)) / n_dot_l;
#endif
    return irradiance * surface.diffuse_albedo / PI;
}

#ifdef SPECULAR
/** Columns: the view's projection onto the surface, across it, and the normal. */
mat3 view_frame(vec3 normal, vec3 view)
{
    vec3 along = view - normal * dot(normal, view);
    float squared = dot(along, along);
    if (squared < FLOAT_EPSILON) {
        vec3 tangent, bitangent;
        orthonormal_basis(normal, tangent, bitangent);
        return mat3(tangent, bitangent, normal);
    }
    along *= inversesqrt(squared);
    return mat3(along, cross(normal, along), normal);
}

#ifdef AREA_LIGHTS
/** Spread factor towards the part of the light that the surface mirrors best: nearest to the reflected view. */
float mirrored_spread(Light light, vec3 center, vec3 normal, vec3 view)
{
    vec3 mirrored = reflect(-view, normal);
    float facing = dot(mirrored, light.axis);
    vec3 hit = facing < 0.0 ? mirrored * (dot(center, light.axis) / facing) - center : vec3(0.0);
    vec2 place = vec2(dot(hit, light.half_x) / dot(light.half_x, light.half_x),
                      dot(hit, light.half_y) / dot(light.half_y, light.half_y));
    place = light.ellipse ? place / max(length(place), 1.0) : clamp(place, -1.0, 1.0);
    vec3 to_light = center + place.x * light.half_x + place.y * light.half_y;
    return spread_factor(light, -dot(to_light, light.axis) * inversesqrt(dot(to_light, to_light)));
}
#endif

/** A light as a highlight shows it: from its centre where it is small, else as a polygon of uniform radiance. */
struct Emitter
{
    vec3 direction;         // unit, to its centre
    vec3 irradiance;        // of a surface that faces it, W/m², from its centre
    float size;             // rad
    Polygon polygon;
    vec3 radiance;
};

Emitter cone_emitter(LightCone cone)
{
    vec3 x, y;
    orthonormal_basis(cone.direction, x, y);
    float cosine = sqrt(max(1.0 - cone.sine * cone.sine, 0.0));
    Polygon disk = ellipse_polygon(cosine * cone.direction, cone.sine * x, cone.sine * y);
    vec3 radiance = cone.irradiance / max(PI * cone.sine * cone.sine, SMALLEST_CONE * SMALLEST_CONE);
    return Emitter(cone.direction, cone.irradiance, cone.sine, disk, radiance);
}

#ifdef AREA_LIGHTS
Emitter area_emitter(Light light, vec3 center, vec3 normal, vec3 view)
{
    vec3 radiance = light.emission;
    if (light.spread_norm > 0.0)
        radiance *= mirrored_spread(light, center, normal, view);
    return Emitter(normalize(center), small_area_irradiance(light, center), angular_size(light, center),
                   light_polygon(light, center), radiance);
}
#endif

/**
 * Radiance towards `view` that the surface reflects specularly of a point, spot, sun or area light, unshadowed.
 *
 * Small lights by the BRDF, large ones by linearly transformed cosines: a light that covers little of the lobe is
 * reflected as its mean direction is, one that covers all of it by the albedo. A spot's edge is taken at the light's
 * centre, an area light's spread at the part that is mirrored best.
 */
vec3 analytic_specular(Light light, Surface surface, vec3 position, vec3 normal, vec3 view)
{
    if (surface.specular_f0 == vec3(0.0))
        return vec3(0.0);
    Emitter emitter;
#ifdef AREA_LIGHTS
    if (light.kind == LIGHT_AREA) {
        vec3 center = light.position - position;
        if (!shines_on(light, center))
            return vec3(0.0);
        emitter = area_emitter(light, center, normal, view);
    } else
#endif
        emitter = cone_emitter(light_cone(light, position));
    float solid = smoothstep(POINT_TO_SOLID.x, POINT_TO_SOLID.y, emitter.size / surface.alpha);
    vec3 reflected = vec3(0.0);
    if (solid < 1.0)
        reflected = emitter.irradiance * specular_brdf_cosine(surface, normal, view, emitter.direction) * (1.0 - solid);
    if (solid > 0.0) {
        mat3 frame = view_frame(normal, view);
        float n_dot_v = clamp(dot(normal, view), 0.0, 1.0);
        Polygon polygon = transformed(transpose(frame), emitter.polygon);
        CoveredLobe lobe = specular_lobe_over(polygon, sqrt(surface.alpha), n_dot_v);
        vec3 by_mean = specular_brdf_cosine(surface, normal, view, frame * lobe.mean) / lobe.density;
        reflected += emitter.radiance * mix(by_mean, surface.specular_albedo, lobe.share) * (lobe.share * solid);
    }
    return reflected;
}
#endif
