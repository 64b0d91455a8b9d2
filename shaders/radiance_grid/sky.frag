// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance (W/m²) of faces by the world: that of the rays which met no face.

#include "radiance_grid/ray.glsl"
#include "common/finite.glsl"
#include "generated/SkyUniforms.glsl"
#include "common/environment.glsl"

uniform usampler2DArray face_links;

layout(location = 0) out vec4 out_sky;

void main()
{
    int face = this_face();
    if (face < first_face || face >= end_face)
        discard;
    Face from = fetch_face(face);
    uvec2 place = texelFetch(face_places, face_texel(face), 0).rg;
    vec3 sum = vec3(0.0);
    for (int index = 0; index < ray_count; ++index) {
        bool met = texelFetch(face_links, ivec3(face_texel(face), index), 0).r != 0u;
        sum += met ? vec3(0.0) : environment_radiance(ray_direction(from, place, index));
    }
    out_sky = vec4(finite_radiance(sum * (PI / float(ray_count))), 0.0);
}
