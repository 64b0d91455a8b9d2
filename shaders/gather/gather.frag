// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance of the nearest layer by cosine-distributed rays: through the layers of the deep G-buffer near the pixel,
// from there on through the radiance grid, and where they meet nothing from the world.

#include "common/camera.glsl"
#include "common/finite.glsl"
#include "common/hash.glsl"
#include "common/layer_radiance.glsl"
#include "common/noisy_irradiance.glsl"
#include "common/octahedral.glsl"
#include "generated/GatherUniforms.glsl"
#include "common/environment.glsl"
#include "common/gather.glsl"
#include "common/radiance_grid.glsl"
#ifdef CONTACT
#include "common/deep_march.glsl"
#else
uniform sampler2DArray view_depth_layers;
#endif

uniform sampler2DArray normal_layers;
uniform sampler2DArray base_color_layers;
uniform sampler2DArray material_layers;
uniform sampler2D face_radiance;
uniform sampler2D face_indirect;
#ifdef SAMPLED_EMISSION
uniform sampler2D face_emission;
#endif

layout(location = 0) out vec4 out_gathered; // irradiance, W/m², and the variance of its luminance
#if defined(DEBUG_GRID_CELLS) || defined(DEBUG_GRID_RADIANCE) || defined(DEBUG_MARCH_HITS) || defined(DEBUG_LIGHT_ORIGIN)
#define SHOWN
layout(location = 1) out vec4 out_origin;
#endif

/** The finest level that holds a position, the coarsest where none does. */
int level_at(vec3 position)
{
    int level = 0;
    while (level < grid_level_count - 1 && !grid_has(ivec3(floor(grid_place(position, level))), level))
        ++level;
    return level;
}

/**
 * The face that a surface belongs to, by its position and unit normal; NO_FACE where there is none.
 *
 * Rounding may put a surface on a cell's side into either cell: the one behind is asked first, then the one before.
 */
int face_at(vec3 position, vec3 normal, int level)
{
    int orientation = orientation_of(normal), face = NO_FACE;
    for (float side = -0.125; side < 0.25 && face == NO_FACE; side += 0.25) {
        ivec3 cell = ivec3(floor(grid_place(position, level) + side * normal));
        uint entry = grid_has(cell, level) ? grid_entry(cell, level) : 0u;
        if ((entry >> uint(orientation) & 1u) != 0u)
            face = face_of(entry, orientation);
    }
    return face;
}

/** How far a surface is behind the plane of the face that it belongs to, along its unit normal, cells; at least 0. */
float depth_behind_face(vec3 position, vec3 normal, int level)
{
    int face = face_at(position, normal, level);
    if (face == NO_FACE)
        return 0.0;
    Plane plane = fetch_plane(face);
    vec3 place = grid_place(position, level);
    float height = dot(plane.normal, place - floor(place) - 0.5) - plane.distance;
    return max(-height / max(dot(plane.normal, normal), 0.5), 0.0);
}

#ifdef CONTACT
/**
 * Radiance that a layer's surface sends against a ray: what lights it directly, and what the grid knows of the rest.
 *
 * 0 where the ray meets its back, of which nothing is known.
 */
vec3 layer_radiance(ivec3 texel, vec3 position, vec3 direction, int level)
{
    vec3 normal = decode_octahedral(texelFetch(normal_layers, texel, 0).rg);
    if (dot(normal, direction) >= 0.0)
        return vec3(0.0);
    float metallic = texelFetch(material_layers, texel, 0).r;
    vec3 albedo = texelFetch(base_color_layers, texel, 0).rgb * (1.0 - metallic);
    int face = face_at(position, normal, level);
    vec3 indirect = face != NO_FACE ? texelFetch(face_indirect, face_texel(face), 0).rgb : vec3(0.0);
    vec3 radiance = shaded_radiance(texel) + albedo / PI * indirect;
#ifdef SAMPLED_EMISSION
    // That of surfaces which are not among the lights.
    radiance += face != NO_FACE ? texelFetch(face_emission, face_texel(face), 0).rgb : vec3(0.0);
#endif
    return radiance;
}
#endif

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy), pixel = gathered_pixel(texel);
    float view_depth = texelFetch(view_depth_layers, ivec3(pixel, 0), 0).r;
    out_gathered = vec4(0.0);
#ifdef SHOWN
    out_origin = vec4(0.0);
#endif
    if (isinf(view_depth))
        return;
    vec2 center = vec2(pixel) + 0.5;
    vec3 position = relative_position(center, view_depth);
    vec3 normal = decode_octahedral(texelFetch(normal_layers, ivec3(pixel, 0), 0).rg);
    int level = level_at(position);
    float offset = (START_OFFSET + depth_behind_face(position, normal, level)) * grid_cell_size(level);
    vec3 sum = vec3(0.0), origins = vec3(0.0);
    float sum_of_squares = 0.0, marched = 0.0;
    for (int ray = 0; ray < gather_rays; ++ray) {
        vec3 direction = cosine_direction(normal, ray_random(texel, ray, gather_rays));
        // Not what chose the direction, or where a ray looks would decide where it steps and what it meets.
        float jitter = fract(hash_to_unit(uvec2(texel)).x + gather_shift.x + float(ray) * 0.6180339887498949);
        vec3 radiance = vec3(0.0);
        bool met = false;
#ifdef CONTACT
        float reach = CONTACT_REACH * grid_cell_size(level);
        vec3 origin = march_origin(position, normal, view_depth);
        MarchHit near = deep_march(origin, direction, reach, contact_steps, jitter);
        met = near.hit;
        if (near.hit) {
            radiance = layer_radiance(ivec3(near.pixel, near.layer), origin + near.distance * direction, direction, level);
            marched += 1.0;
            origins.r += 1.0;
        }
#endif
        if (!met) {
            GridHit far = trace_grid(position + offset * normal, direction, level, jitter);
            if (far.face != NO_FACE) {
                radiance = texelFetch(face_radiance, face_texel(far.face), 0).rgb;
                origins.g += 1.0;
            }
            else {
                origins.b += 1.0;
#ifdef WORLD
                radiance = environment_radiance(direction);
#endif
            }
        }
        radiance = finite_radiance(radiance);
        float brightness = luminance(radiance);
        sum += radiance;
        sum_of_squares += brightness * brightness;
    }
    float count = float(gather_rays);
    out_gathered = noisy_irradiance(sum * (PI / count), PI * mean_deviation(luminance(sum), sum_of_squares, gather_rays));
#if defined(DEBUG_MARCH_HITS)
    out_origin = vec4(vec3(marched / count), 1.0);
#elif defined(DEBUG_LIGHT_ORIGIN)
    out_origin = vec4(origins / count, 1.0);
#elif defined(DEBUG_GRID_CELLS) || defined(DEBUG_GRID_RADIANCE)
    int face = face_at(position, normal, level);
#ifdef DEBUG_GRID_CELLS
    vec2 random = hash_to_unit(uvec2(face, 0));
    out_origin = face != NO_FACE ? vec4(random, hash_to_unit(uvec2(face, 1)).x, 1.0) : vec4(0.0);
#else
    out_origin = face != NO_FACE ? texelFetch(face_radiance, face_texel(face), 0) : vec4(0.0);
#endif
#endif
}
