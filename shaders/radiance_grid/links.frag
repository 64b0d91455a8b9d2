// SPDX-License-Identifier: GPL-3.0-or-later
// One ray of every face: which face it meets. KEPT: rays that cannot have met what changed are taken from the grid before.

#include "radiance_grid/ray.glsl"

#ifdef KEPT
#include "generated/ChangeUniforms.glsl"

uniform usampler2D face_sources;      // which face of the grid before this one was, plus 1, 0 for none
uniform usampler2D face_moved;        // which face one of the grid before has become, plus 1, 0 for none
uniform usampler2DArray links_before;
#endif

layout(location = 0) out uint out_link; // the face that was met plus 1, 0 for none

#ifdef KEPT
const float NEVER = 1e30;

/** Distance along a ray to where it enters the box of what changed, m; NEVER where it does not. */
float distance_to_change(vec3 origin, vec3 direction)
{
    vec3 slow = mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
    vec3 one = (changed_low.xyz - origin) / slow, two = (changed_high.xyz - origin) / slow;
    vec3 enter = min(one, two), leave = max(one, two);
    float start = max(max(enter.x, enter.y), max(enter.z, 0.0)), end = min(leave.x, min(leave.y, leave.z));
    return start <= end ? start : NEVER;
}

/** The link that a ray of a face had before, for the faces as they are numbered now; false where it may be another. */
bool kept_link(int face, vec3 origin, vec3 direction, out uint link)
{
    link = 0u;
    uint source = texelFetch(face_sources, face_texel(face), 0).r;
    if (source == 0u)
        return false;
    uint met = texelFetch(links_before, ivec3(face_texel(int(source) - 1), ray), 0).r;
    float change = distance_to_change(origin, direction);
    if (met == 0u)
        return change >= NEVER;
    link = texelFetch(face_moved, face_texel(int(met) - 1), 0).r;
    if (link == 0u)
        return false;
    Face target = fetch_face(int(link) - 1);
    return change > length(target.position - origin) + 2.0 * target.cell; // its plane goes on in all of its cell
}
#endif

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
#ifdef KEPT
    if (kept_link(face, origin, direction, out_link))
        return;
#endif
    out_link = uint(trace_grid(origin, direction, from.level, random).face + 1);
}
