// SPDX-License-Identifier: GPL-3.0-or-later
// Light samples. The table's rows are documented in render/light_table.py; positions are camera-relative.

#include "common/constants.glsl"

const int LIGHT_POINT = 0;
const int LIGHT_SUN = 1;
const int LIGHT_SPOT = 2;
const int LIGHT_AREA = 3;
const int SHAPE_ELLIPSE = 1;

uniform sampler2D light_table;

struct Light
{
    int kind;
    vec3 position;
    vec3 axis;              // unit, where it shines
    float radius;           // m; of a sun: half angle, rad
    vec3 emission;
    float cone_cosine;      // of a spot's half angle
    float cone_softness;    // width of its soft edge, in cosines
    vec3 half_x;
    vec3 half_y;
    bool ellipse;
    float diffuse_factor;
    float specular_factor;
    float spread_slope;     // of an area light; of a point or spot light: above 0 where it is a disk
    float spread_norm;
};

struct LightSample
{
    vec3 direction;         // unit, from the surface to the light
    vec3 weight;            // incident radiance over the probability density in solid angle: irradiance per n·l, W/m²
};

Light fetch_light(int index)
{
    ivec2 first = ivec2(index % LIGHTS_PER_ROW * TEXELS_PER_LIGHT, index / LIGHTS_PER_ROW);
    vec4 row_0 = texelFetch(light_table, first + ivec2(0, 0), 0);
    vec4 row_1 = texelFetch(light_table, first + ivec2(1, 0), 0);
    vec4 row_2 = texelFetch(light_table, first + ivec2(2, 0), 0);
    vec4 row_3 = texelFetch(light_table, first + ivec2(3, 0), 0);
    vec4 row_4 = texelFetch(light_table, first + ivec2(4, 0), 0);
    vec4 row_5 = texelFetch(light_table, first + ivec2(5, 0), 0);
    return Light(int(row_0.w), row_0.xyz, row_1.xyz, row_1.w, row_2.rgb, row_2.w, row_3.w, row_3.xyz, row_4.xyz,
                 int(row_4.w) == SHAPE_ELLIPSE, row_5.x, row_5.y, row_5.z, row_5.w);
}

/** Whether other (u, v) give other samples. */
bool is_extended(Light light)
{
    return light.kind == LIGHT_AREA || light.radius > 0.0;
}

/** Unit square -> unit disk, area preserving (Shirley and Chiu 1997). */
vec2 sample_disk(vec2 u)
{
    vec2 p = 2.0 * u - 1.0;
    if (p == vec2(0.0))
        return p;
    bool wide = abs(p.x) > abs(p.y);
    float radius = wide ? p.x : p.y;
    float angle = wide ? 0.25 * PI * p.y / p.x : 0.5 * PI - 0.25 * PI * p.x / p.y;
    return radius * vec2(cos(angle), sin(angle));
}

/** Two unit vectors perpendicular to n (Duff et al. 2017, "Building an Orthonormal Basis, Revisited"). */
void orthonormal_basis(vec3 n, out vec3 tangent, out vec3 bitangent)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    bitangent = vec3(b, s + n.y * n.y * a, -n.y);
}

/** Direction uniform in solid angle within a cone about `axis` whose half angle has this squared sine. */
vec3 sample_cone(vec3 axis, float sine_squared, vec2 u)
{
    float one_minus_cosine = sine_squared / (1.0 + sqrt(max(1.0 - sine_squared, 0.0)));
    vec2 disk = sample_disk(u);
    float share = dot(disk, disk);
    float drop = share * one_minus_cosine;
    float sine = sqrt(max(drop * (2.0 - drop), 0.0));
    vec2 around = share > 0.0 ? disk * (sine / sqrt(share)) : vec2(0.0);
    vec3 tangent, bitangent;
    orthonormal_basis(axis, tangent, bitangent);
    return tangent * around.x + bitangent * around.y + axis * (1.0 - drop);
}

/** Solid angle of that cone over the solid angle projected onto its axis, π sin²; tends to 1 for a narrow cone. */
float cone_flattening(float sine_squared)
{
    return 2.0 / (1.0 + sqrt(max(1.0 - sine_squared, 0.0)));
}

LightSample sample_sun(Light light, vec2 u)
{
    float sine = sin(light.radius);
    return LightSample(sample_cone(-light.axis, sine * sine, u), light.emission * cone_flattening(sine * sine));
}

LightSample sample_area(Light light, vec3 position, vec2 u)
{
    vec2 p = light.ellipse ? sample_disk(u) : 2.0 * u - 1.0;
    float area = length(light.half_x) * length(light.half_y) * (light.ellipse ? PI : 4.0);
    vec3 to_light = light.position + p.x * light.half_x + p.y * light.half_y - position;
    float distance_squared = dot(to_light, to_light);
    vec3 direction = to_light * inversesqrt(distance_squared);
    float cosine = -dot(direction, light.axis);
    if (!(distance_squared > 0.0 && cosine > 0.0))
        return LightSample(-light.axis, vec3(0.0));
    // Spread: radiance falls with the slope from the axis, normalised to the flux of a Lambertian emitter.
    float spread = 1.0;
    if (light.spread_norm > 0.0)
        spread = max(light.spread_slope - sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine, 0.0) / light.spread_norm;
    return LightSample(direction, light.emission * (spread * area * cosine / distance_squared));
}

/** A disk of the light's radius that faces the surface (Blender's soft falloff): finite however near. */
LightSample sample_facing_disk(Light light, vec3 to_light, float distance_squared, vec2 u)
{
    vec2 p = light.radius * sample_disk(u);
    float on_disk_squared = distance_squared + dot(p, p);
    vec3 tangent, bitangent;
    orthonormal_basis(to_light * inversesqrt(distance_squared), tangent, bitangent);
    vec3 direction = (to_light + p.x * tangent + p.y * bitangent) * inversesqrt(on_disk_squared);
    return LightSample(direction, light.emission * (sqrt(distance_squared / on_disk_squared) / on_disk_squared));
}

LightSample sample_sphere(Light light, vec3 to_light, float distance_squared, vec2 u)
{
    float radius_squared = light.radius * light.radius;
    float sine_squared = min(radius_squared / distance_squared, 1.0);
    vec3 direction = sample_cone(to_light * inversesqrt(distance_squared), sine_squared, u);
    return LightSample(direction,
                       light.emission * (cone_flattening(sine_squared) / max(distance_squared, radius_squared)));
}

/** Sample a light from `position` with (u, v) in [0, 1)². An unlit sample has weight 0. */
LightSample sample_light(Light light, vec3 position, vec2 u)
{
#ifdef SUN_LIGHTS
    if (light.kind == LIGHT_SUN)
        return sample_sun(light, u);
#endif
#ifdef AREA_LIGHTS
    if (light.kind == LIGHT_AREA)
        return sample_area(light, position, u);
#endif
    LightSample result = LightSample(-light.axis, vec3(0.0));
#if defined(SPHERE_LIGHTS) || defined(DISK_LIGHTS)
    vec3 to_light = light.position - position;
    float distance_squared = dot(to_light, to_light);
    if (distance_squared == 0.0)
        return result;
#if defined(SPHERE_LIGHTS) && defined(DISK_LIGHTS)
    if (light.spread_slope > 0.0)
        result = sample_facing_disk(light, to_light, distance_squared, u);
    else
        result = sample_sphere(light, to_light, distance_squared, u);
#elif defined(DISK_LIGHTS)
    result = sample_facing_disk(light, to_light, distance_squared, u);
#else
    result = sample_sphere(light, to_light, distance_squared, u);
#endif
#ifdef SPOT_CONES
    if (light.kind == LIGHT_SPOT)
        result.weight *=
            smoothstep(0.0, 1.0, (-dot(result.direction, light.axis) - light.cone_cosine) / light.cone_softness);
#endif
#endif
    return result;
}
