// SPDX-License-Identifier: GPL-3.0-or-later
// One ray of every face: which face it meets.

#include "radiance_grid/ray.glsl"

layout(location = 0) out uint out_link; // the face that was met plus 1, 0 for none

void main()
{
    int face = this_face();
    if (face < first_face || face >= end_face)
        discard;
    Face from = fetch_face(face);
    uvec2 place = texelFetch(face_places, face_texel(face), 0).rg;
    vec3 direction = ray_direction(from, place, ray);
    float random = hash_to_unit(place + uint(ray) * uvec2(2654435761u, 40503u)).x;
    vec3 origin = from.position + START_OFFSET * from.cell * from.normal;
    out_link = uint(trace_grid(origin, direction, from.level, 0.0, random).face + 1);
}
