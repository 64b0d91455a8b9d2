// SPDX-License-Identifier: GPL-3.0-or-later
// Light samples. The table's rows are documented in render/light_table.py; positions are camera-relative.

#include "common/constants.glsl"

const int LIGHT_POINT = 0;
const int LIGHT_SUN = 1;
const int LIGHT_SPOT = 2;
const int LIGHT_AREA = 3;
const int SHAPE_ELLIPSE = 1;

uniform sampler2D light_table;

struct LightSample
{
    vec3 direction;         // unit, from the surface to the light
    vec3 weight;            // incident radiance over the probability density in solid angle: irradiance per n·l, W/m²
    float diffuse_factor;
    float specular_factor;
    bool extended;          // whether other (u, v) give other samples
};

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

/** Sample light `index` from `position` with (u, v) in [0, 1)². An unlit sample has weight 0. */
LightSample sample_light(int index, vec3 position, vec2 u)
{
    vec4 place = texelFetch(light_table, ivec2(0, index), 0);
    vec4 axis = texelFetch(light_table, ivec2(1, index), 0);
    vec4 emission = texelFetch(light_table, ivec2(2, index), 0);
    vec4 half_x = texelFetch(light_table, ivec2(3, index), 0);
    vec4 half_y = texelFetch(light_table, ivec2(4, index), 0);
    vec4 factors = texelFetch(light_table, ivec2(5, index), 0);
    int kind = int(place.w);

    LightSample result;
    result.diffuse_factor = factors.x;
    result.specular_factor = factors.y;
    result.extended = kind == LIGHT_AREA || axis.w > 0.0;
    result.direction = -axis.xyz;
    result.weight = vec3(0.0);

    if (kind == LIGHT_SUN) {
        float sine = sin(axis.w);
        result.direction = sample_cone(-axis.xyz, sine * sine, u);
        result.weight = emission.rgb * cone_flattening(sine * sine);
        return result;
    }
    if (kind == LIGHT_AREA) {
        bool ellipse = int(half_y.w) == SHAPE_ELLIPSE;
        vec2 p = ellipse ? sample_disk(u) : 2.0 * u - 1.0;
        float area = length(half_x.xyz) * length(half_y.xyz) * (ellipse ? PI : 4.0);
        vec3 to_light = place.xyz + p.x * half_x.xyz + p.y * half_y.xyz - position;
        float distance_squared = dot(to_light, to_light);
        if (distance_squared == 0.0)
            return result;
        result.direction = to_light * inversesqrt(distance_squared);
        float cosine = -dot(result.direction, axis.xyz);
        if (cosine <= 0.0)
            return result;
        // Spread: radiance falls with the slope from the axis, normalised to the flux of a Lambertian emitter.
        float spread = 1.0;
        if (factors.w > 0.0)
            spread = max(factors.z - sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine, 0.0) / factors.w;
        result.weight = emission.rgb * (spread * area * cosine / distance_squared);
        return result;
    }
    vec3 to_light = place.xyz - position;
    float distance_squared = dot(to_light, to_light);
    if (distance_squared == 0.0)
        return result;
    result.direction = to_light * inversesqrt(distance_squared);
    float cone = 1.0;
    if (kind == LIGHT_SPOT)
        cone = smoothstep(0.0, 1.0, (-dot(result.direction, axis.xyz) - emission.w) / half_x.w);
    if (factors.z > 0.0) {
        // A disk that faces the surface (Blender's soft falloff): finite however near, and never cut by it.
        vec2 p = axis.w * sample_disk(u);
        float on_disk_squared = distance_squared + dot(p, p);
        vec3 tangent, bitangent;
        orthonormal_basis(result.direction, tangent, bitangent);
        result.direction = (to_light + p.x * tangent + p.y * bitangent) * inversesqrt(on_disk_squared);
        float cosine = sqrt(distance_squared / on_disk_squared);
        result.weight = emission.rgb * (cone * cosine / on_disk_squared);
        return result;
    }
    float sine_squared = min(axis.w * axis.w / distance_squared, 1.0);
    result.direction = sample_cone(result.direction, sine_squared, u);
    result.weight = emission.rgb * (cone * cone_flattening(sine_squared) / max(distance_squared, axis.w * axis.w));
    return result;
}
