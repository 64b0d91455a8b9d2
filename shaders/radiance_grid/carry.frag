// SPDX-License-Identifier: GPL-3.0-or-later
// What rays that are sent from pixels see. The finest faces get their own direct light, and the rest from the faces of
// the next level around them; other faces keep what was found. Emission is added to both.

#include "common/constants.glsl"
#include "common/finite.glsl"
#include "radiance_grid/face.glsl"

uniform sampler2D face_albedo;
uniform sampler2D face_emission;
uniform sampler2D face_direct;
uniform sampler2D face_indirect;
uniform sampler2D face_radiance;

layout(location = 0) out vec4 out_indirect; // irradiance by world and other faces, W/m²
layout(location = 1) out vec4 out_radiance; // W/(sr·m²)

/** Trilinear mean of the next level's faces of the same orientation, of those that exist; else of any in the cell. */
vec3 coarser_indirect(Face face)
{
    int level = face.level + 1;
    vec3 place = grid_place(face.position, level) - 0.5;
    ivec3 low = ivec3(floor(place));
    vec3 share = place - vec3(low);
    vec3 sum = vec3(0.0);
    float total = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        ivec3 side = ivec3(corner & 1, corner >> 1 & 1, corner >> 2);
        ivec3 cell = low + side;
        if (!grid_has(cell, level))
            continue;
        uint entry = grid_entry(cell, level);
        if ((entry >> uint(face.orientation) & 1u) == 0u)
            continue;
        vec3 weights = mix(1.0 - share, share, vec3(side));
        float weight = weights.x * weights.y * weights.z + 1e-6;
        sum += weight * texelFetch(face_indirect, face_texel(face_of(entry, face.orientation)), 0).rgb;
        total += weight;
    }
    return sum / max(total, 1e-6);
}

void main()
{
    int face = this_face();
    if (face < first_face || face >= end_face)
        discard;
    ivec2 texel = face_texel(face);
    vec3 emission = texelFetch(face_emission, texel, 0).rgb;
    Face own = fetch_face(face);
    if (own.level > 0) {
        out_indirect = texelFetch(face_indirect, texel, 0);
        out_radiance = vec4(finite_radiance(emission + texelFetch(face_radiance, texel, 0).rgb), 0.0);
        return;
    }
    vec3 indirect = coarser_indirect(own);
    vec3 reflected = texelFetch(face_albedo, texel, 0).rgb / PI * (texelFetch(face_direct, texel, 0).rgb + indirect);
    out_indirect = vec4(finite_radiance(indirect), 0.0);
    out_radiance = vec4(finite_radiance(emission + reflected), 0.0);
}
