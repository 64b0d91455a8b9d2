// SPDX-License-Identifier: GPL-3.0-or-later
// Lights and the points at which a sample of the film samples them. The rows of light_table are documented in
// render/light_table.py; positions are camera-relative. light_samples has three texels a light:
// 0 the point: of area lights −1…1 along the half axes; of points, spots and suns in the unit ball, world axes; of
//   emissive surfaces the position · how many shadow maps, −1 for the faces of a cube
// 1 normal of an emissive surface there; of lamps the point's position · its first shadow map
// 2 square of how far the light reaches in this sample, and in every sample, m² · 1 where its point is always the same ·
//   share of the light that the point stands for, 0 in a preview

#include "common/basis.glsl"
#include "common/constants.glsl"

const int LIGHT_POINT = 0;
const int LIGHT_SUN = 1;
const int LIGHT_SPOT = 2;
const int LIGHT_AREA = 3;
const int LIGHT_MESH = 4;
const int LIGHT_WORLD = 5;
const int SHAPE_ELLIPSE = 1;

uniform sampler2D light_table;
uniform sampler2D light_samples;

struct Light
{
    int kind;
    vec3 position;
    vec3 axis;              // unit, where it shines
    float radius;           // m; of a sun: half angle, rad; of an emissive surface: area, m²
    vec3 emission;
    float cone_cosine;      // of a spot's half angle
    float cone_softness;    // width of its soft edge, in cosines
    vec3 half_x;
    vec3 half_y;
    bool ellipse;
    float diffuse_factor;
    float specular_factor;
    float spread_slope;     // of an area light; point or spot: above 0 where it is a disk; surface: whether its front shines
    float spread_norm;      // of an area light; of an emissive surface whether its back shines
};

/** Where a light is sampled, the same for all pixels. */
struct LightPoint
{
    vec3 offset;
    vec3 normal;            // of an emissive surface; of a lamp its sampled position
    int shadow_count;
    int shadow_first;
    bool is_fixed;          // whether every sample has the same point
    float share;            // of the light that the point stands for
};

struct LightSample
{
    vec3 direction;         // unit, from the surface to the light
    vec3 weight;            // incident radiance over the probability density in solid angle: irradiance per n·l, W/m²
};

/** The first texel of a light in a table with so many texels a light. */
ivec2 light_texel(int index, int texels)
{
    return ivec2(index % LIGHTS_PER_ROW * texels, index / LIGHTS_PER_ROW);
}

LightPoint fetch_light_point(int index)
{
    ivec2 first = light_texel(index, TEXELS_PER_SAMPLE);
    vec4 point = texelFetch(light_samples, first, 0);
    vec4 normal = texelFetch(light_samples, first + ivec2(1, 0), 0);
    vec4 reach = texelFetch(light_samples, first + ivec2(2, 0), 0);
    return LightPoint(point.xyz, normal.xyz, int(point.w), int(normal.w), reach.z > 0.0, reach.w);
}

#ifdef LINKING
/** Whether a light shines on instances of a link group. */
bool lights_group(int index, int group)
{
    vec4 words = texelFetch(light_table, light_texel(index, TEXELS_PER_LIGHT) + ivec2(6, 0), 0);
    return (int(words[group / 16]) >> (group % 16) & 1) != 0;
}
#endif

Light fetch_light(int index)
{
    ivec2 first = light_texel(index, TEXELS_PER_LIGHT);
    vec4 row_0 = texelFetch(light_table, first + ivec2(0, 0), 0);
    vec4 row_1 = texelFetch(light_table, first + ivec2(1, 0), 0);
    vec4 row_2 = texelFetch(light_table, first + ivec2(2, 0), 0);
    vec4 row_3 = texelFetch(light_table, first + ivec2(3, 0), 0);
    vec4 row_4 = texelFetch(light_table, first + ivec2(4, 0), 0);
    vec4 row_5 = texelFetch(light_table, first + ivec2(5, 0), 0);
    return Light(int(row_0.w), row_0.xyz, row_1.xyz, row_1.w, row_2.rgb, row_2.w, row_3.w, row_3.xyz, row_4.xyz,
                 int(row_4.w) == SHAPE_ELLIPSE, row_5.x, row_5.y, row_5.z, row_5.w);
}

/** The part of a vector across a unit axis. */
vec3 across(vec3 axis, vec3 vector)
{
    return vector - axis * dot(axis, vector);
}

/**
 * Direction uniform in solid angle within a cone about `axis` whose half angle has this squared sine, where `disk`, a
 * vector across the axis, is uniform in the unit disk.
 */
vec3 sample_cone(vec3 axis, float sine_squared, vec3 disk)
{
    float one_minus_cosine = sine_squared / (1.0 + sqrt(max(1.0 - sine_squared, 0.0)));
    float share = dot(disk, disk);
    float drop = share * one_minus_cosine;
    float sine = sqrt(max(drop * (2.0 - drop), 0.0));
    return (share > 0.0 ? disk * (sine / sqrt(share)) : vec3(0.0)) + axis * (1.0 - drop);
}

/** Solid angle of that cone over the solid angle projected onto its axis, π sin²; tends to 1 for a narrow cone. */
float cone_flattening(float sine_squared)
{
    return 2.0 / (1.0 + sqrt(max(1.0 - sine_squared, 0.0)));
}

LightSample sample_sun(Light light, vec3 offset)
{
    float sine = sin(light.radius);
    return LightSample(sample_cone(-light.axis, sine * sine, across(light.axis, offset)),
                       light.emission * cone_flattening(sine * sine));
}

/** Area of an area light, m². */
float light_area(Light light)
{
    return length(light.half_x) * length(light.half_y) * (light.ellipse ? PI : 4.0);
}

/**
 * Radiance of an area light in a direction with this cosine > 0 to its axis, over its emission: it falls with the slope
 * from the axis, normalised to the flux of a Lambertian emitter.
 */
float spread_factor(Light light, float cosine)
{
    if (light.spread_norm <= 0.0)
        return 1.0;
    return max(light.spread_slope - sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine, 0.0) / light.spread_norm;
}

/**
 * Solid angle (sr) that an area (m²) seen from a squared distance (m²) at a cosine seems to have by one point of it.
 *
 * Within √2 radii of the patch that the point stands for, its radius is taken into account: right above its middle
 * exactly (a disk's π r²/(d² + r²)), elsewhere so that the sum over points stays finite however near the surface is.
 */
float patch_solid_angle(float area, float share, float distance_squared, float cosine)
{
    float radius_squared = area * share / PI;
    float near = radius_squared * clamp(1.0 - distance_squared / (2.0 * max(radius_squared, 1e-30)), 0.0, 1.0);
    float height_squared = cosine * cosine * distance_squared;
    float softened = distance_squared + near;
    return area * sqrt((height_squared + near) / softened) / softened;
}

LightSample sample_area(Light light, vec3 position, LightPoint point)
{
    vec2 offset = point.offset.xy;
    vec3 to_light = light.position + offset.x * light.half_x + offset.y * light.half_y - position;
    float distance_squared = dot(to_light, to_light);
    vec3 direction = to_light * inversesqrt(distance_squared);
    float cosine = -dot(direction, light.axis);
    if (!(distance_squared > 0.0 && cosine > 0.0))
        return LightSample(-light.axis, vec3(0.0));
    float solid_angle = patch_solid_angle(light_area(light), point.share, distance_squared, cosine);
    return LightSample(direction, light.emission * (spread_factor(light, cosine) * solid_angle));
}

/** An emissive surface, sampled at a position (camera-relative) with unit normal, uniformly over its area. */
LightSample sample_mesh(Light light, vec3 position, LightPoint point)
{
    vec3 to_light = point.offset - position;
    float distance_squared = dot(to_light, to_light);
    if (!(distance_squared > 0.0))
        return LightSample(point.normal, vec3(0.0));
    vec3 direction = to_light * inversesqrt(distance_squared);
    float cosine = -dot(direction, point.normal);
    bool shines = cosine > 0.0 ? light.spread_slope > 0.0 : light.spread_norm > 0.0;
    float weight = shines ? patch_solid_angle(light.radius, point.share, distance_squared, abs(cosine)) : 0.0;
    return LightSample(direction, light.emission * weight);
}

/** A disk of the light's radius that faces the surface (Blender's soft falloff): finite however near. */
LightSample sample_facing_disk(Light light, vec3 to_light, float distance_squared, vec3 offset)
{
    vec3 on_disk = light.radius * across(to_light * inversesqrt(distance_squared), offset);
    float on_disk_squared = distance_squared + dot(on_disk, on_disk);
    vec3 direction = (to_light + on_disk) * inversesqrt(on_disk_squared);
    return LightSample(direction, light.emission * (sqrt(distance_squared / on_disk_squared) / on_disk_squared));
}

LightSample sample_sphere(Light light, vec3 to_light, float distance_squared, vec3 offset)
{
    float radius_squared = light.radius * light.radius;
    float sine_squared = min(radius_squared / distance_squared, 1.0);
    vec3 axis = to_light * inversesqrt(distance_squared);
    vec3 direction = sample_cone(axis, sine_squared, across(axis, offset));
    return LightSample(direction,
                       light.emission * (cone_flattening(sine_squared) / max(distance_squared, radius_squared)));
}

/** What a light sends to `position` from its sampled point. An unlit sample has weight 0. */
LightSample sample_light(Light light, vec3 position, LightPoint point)
{
#if defined(SUN_LIGHTS) || defined(WORLD_LIGHTS)
    if (light.kind == LIGHT_SUN || light.kind == LIGHT_WORLD)
        return sample_sun(light, point.offset);
#endif
#ifdef AREA_LIGHTS
    if (light.kind == LIGHT_AREA)
        return sample_area(light, position, point);
#endif
#ifdef MESH_LIGHTS
    if (light.kind == LIGHT_MESH)
        return sample_mesh(light, position, point);
#endif
    LightSample result = LightSample(-light.axis, vec3(0.0));
#if defined(SPHERE_LIGHTS) || defined(DISK_LIGHTS)
    vec3 to_light = light.position - position;
    float distance_squared = dot(to_light, to_light);
    if (distance_squared == 0.0)
        return result;
#if defined(SPHERE_LIGHTS) && defined(DISK_LIGHTS)
    if (light.spread_slope > 0.0)
        result = sample_facing_disk(light, to_light, distance_squared, point.offset);
    else
        result = sample_sphere(light, to_light, distance_squared, point.offset);
#elif defined(DISK_LIGHTS)
    result = sample_facing_disk(light, to_light, distance_squared, point.offset);
#else
    result = sample_sphere(light, to_light, distance_squared, point.offset);
#endif
#ifdef SPOT_CONES
    if (light.kind == LIGHT_SPOT)
        result.weight *=
            smoothstep(0.0, 1.0, (-dot(result.direction, light.axis) - light.cone_cosine) / light.cone_softness);
#endif
#endif
    return result;
}

/** Camera-relative position (m) that the shadow maps of a light are drawn from. */
vec3 light_origin(Light light, LightPoint point)
{
    return light.kind == LIGHT_MESH ? point.offset : point.normal;
}

/** Radius (m) of a disk as large as a lamp; of a sun the tangent of its angular radius. */
float light_radius(Light light)
{
    if (light.kind == LIGHT_AREA)
        return sqrt(length(light.half_x) * length(light.half_y) * (light.ellipse ? 1.0 : 4.0 / PI));
    return light.kind == LIGHT_SUN ? tan(light.radius) : light.radius;
}
