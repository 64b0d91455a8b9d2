// SPDX-License-Identifier: GPL-3.0-or-later
// Light that faces get from others by one more bounce: what their rays meet sends what it was found to reflect before.

#include "common/constants.glsl"
#include "common/finite.glsl"
#include "radiance_grid/face.glsl"

uniform usampler2DArray face_links;
uniform sampler2D face_albedo;
uniform sampler2D face_direct;
uniform sampler2D face_first;
uniform sampler2D face_radiance;

layout(location = 0) out vec4 out_indirect; // irradiance by world and other faces, W/m²
layout(location = 1) out vec4 out_radiance; // that is reflected, W/(sr·m²)

void main()
{
    int face = this_face();
    if (face < first_face || face >= end_face)
        discard;
    ivec2 texel = face_texel(face);
    vec3 sum = vec3(0.0);
    for (int ray = 0; ray < ray_count; ++ray) {
        uint link = texelFetch(face_links, ivec3(texel, ray), 0).r;
        vec3 radiance = texelFetch(face_radiance, face_texel(int(max(link, 1u)) - 1), 0).rgb;
        sum += link != 0u ? radiance : vec3(0.0);
    }
    vec3 indirect = texelFetch(face_first, texel, 0).rgb + sum * (PI / float(max(ray_count, 1)));
    vec3 reflected = texelFetch(face_albedo, texel, 0).rgb / PI * (texelFetch(face_direct, texel, 0).rgb + indirect);
    out_indirect = vec4(finite_radiance(indirect), 0.0);
    out_radiance = vec4(finite_radiance(reflected), 0.0);
}
