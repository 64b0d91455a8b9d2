// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance (W/m²) of faces by what their rays meet first: emission, or the world where they meet no face. WORLD:
// there is one to be met.

#include "radiance_grid/ray.glsl"
#include "common/finite.glsl"
#include "generated/SkyUniforms.glsl"
#include "common/environment.glsl"

uniform usampler2DArray face_links;
uniform sampler2D face_emission;

layout(location = 0) out vec4 out_first;

void main()
{
    int face = this_face();
    if (face < first_face || face >= end_face)
        discard;
    Face from = fetch_face(face);
    uvec2 place = texelFetch(face_places, face_texel(face), 0).rg;
    vec3 sum = vec3(0.0);
    for (int index = 0; index < ray_count; ++index) {
        uint link = texelFetch(face_links, ivec3(face_texel(face), index), 0).r;
        vec3 radiance = texelFetch(face_emission, face_texel(int(max(link, 1u)) - 1), 0).rgb;
#ifdef WORLD
        sum += link != 0u ? radiance : environment_radiance(ray_direction(from, place, index));
#else
        sum += link != 0u ? radiance : vec3(0.0);
#endif
    }
    out_first = vec4(finite_radiance(sum * (PI / float(ray_count))), 0.0);
}
