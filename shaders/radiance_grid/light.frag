// SPDX-License-Identifier: GPL-3.0-or-later
// Irradiance (W/m²) of faces by lamps and by emissive surfaces that are sampled as lights.

#include "common/direct_light.glsl"
#include "common/finite.glsl"
#include "radiance_grid/face.glsl"

layout(location = 0) out vec4 out_direct;

void main()
{
    int face = this_face();
    if (face < first_face || face >= end_face)
        discard;
    Face lit_face = fetch_face(face);
    Shading shading;
    shading.normal = lit_face.normal;
    shading.view = lit_face.normal;
    shading.surface = make_surface(vec3(1.0), 0.0, 0.0, 1.0, 0.0, 1.0);
    shading.world_surface = shading.surface;
    shading.position = lit_face.position;
    shading.precision_along_view = START_OFFSET * lit_face.cell; // what is nearer than that casts no shadow on it
    shading.link_group = 0;
    shading.random = vec2(0.5);
    out_direct = vec4(finite_radiance(share * PI * lit(shading).diffuse), 0.0);
}
