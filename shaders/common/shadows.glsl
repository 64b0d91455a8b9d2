// SPDX-License-Identifier: GPL-3.0-or-later
// Whether light arrives: lookups into the shadow maps that shaders/shadow_maps draws. Needs common/lights.glsl.
// Positions are camera-relative, m.

#include "common/caster_plane.glsl"

uniform usampler2DArray shadow_atlas;
uniform sampler2D shadow_table; // six texels a map, see render/shadow_table.py

// Planes of casters and receivers are known to this part of a texel or pixel: vertices are snapped to such a grid.
const float SUBPIXEL = 1.0 / 256.0;
// Rounding of positions that were computed in a few steps.
const float POSITION_EPSILON = 4.0 * FLOAT_EPSILON;

struct ShadowMap
{
    vec4 row_x;
    vec4 row_y;
    vec4 row_nearness;
    vec4 row_w;
    vec2 corner;        // lower left texel
    float size;         // texels a side, 0: nothing is there
    int page;
    float texel;        // width at distance 1, orthographic: m
    bool orthographic;
    float extent;       // m from where it is seen from to the farthest corner of what casts shadows on it
};

/** A receiver: where it is, its unit normal, and how exactly its position is known, m. */
struct Receiver
{
    vec3 position;
    vec3 normal;
    float precision_along_view;
};

ShadowMap fetch_shadow_map(int index)
{
    ivec2 first = light_texel(index, TEXELS_PER_MAP);
    vec4 place = texelFetch(shadow_table, first + ivec2(4, 0), 0);
    vec4 optics = texelFetch(shadow_table, first + ivec2(5, 0), 0);
    return ShadowMap(texelFetch(shadow_table, first, 0), texelFetch(shadow_table, first + ivec2(1, 0), 0),
                     texelFetch(shadow_table, first + ivec2(2, 0), 0), texelFetch(shadow_table, first + ivec2(3, 0), 0),
                     place.xy, place.z, int(place.w), optics.x, optics.y > 0.0, optics.z);
}

/** Texel x, y of the map's page, and nearness: 1/z in perspective maps, z_end - z in orthographic ones. */
vec3 to_map(ShadowMap map, vec3 position)
{
    vec4 point = vec4(position, 1.0);
    return vec3(dot(map.row_x, point), dot(map.row_y, point), dot(map.row_nearness, point)) / dot(map.row_w, point);
}

/** Whether a point of the page is on the map, by `margin` texels. */
bool on_map(ShadowMap map, vec2 point, float margin)
{
    vec2 inner = point - map.corner;
    return all(greaterThanEqual(inner, vec2(margin))) && all(lessThanEqual(inner, vec2(map.size - margin)));
}

/** The caster nearest to the light in a texel: nearness at its centre, 0 where there is none, and change per texel. */
vec3 fetch_caster(ShadowMap map, ivec2 texel)
{
    uvec2 plane = texelFetch(shadow_atlas, ivec3(texel, map.page), 0).rg;
    float nearness = uintBitsToFloat(plane.x);
    return vec3(nearness, decode_slope(plane.y) * slope_unit(map.orthographic, nearness, map.texel));
}

/** Metres along the light as a difference of nearness. */
float nearness_of(ShadowMap map, float nearness, float metres)
{
    return map.orthographic ? metres : metres * nearness * nearness;
}

/**
 * How far, as a difference of nearness, a receiver may seem nearer or farther than it is.
 *
 * Its place is off by `precision_along_view` and by rounding, as casters' planes are by that of their vertices; light at a small angle makes more of it.
 */
float receiver_tolerance(ShadowMap map, Receiver receiver, float nearness, float n_dot_l)
{
    float place = receiver.precision_along_view + POSITION_EPSILON * (length(receiver.position) + map.extent);
    float rounding = map.orthographic ? abs(map.row_nearness.w) + nearness : nearness;
    return nearness_of(map, nearness, place / max(n_dot_l, 0.02)) + POSITION_EPSILON * rounding;
}

/**
 * Change per texel of the nearness of a receiver's tangent plane. `distance`: to the light, m; 1 in orthographic maps.
 *
 * On the plane through q with normal n a ray r from the light has n·r z = n·q: 1/z changes with the ray as n does.
 */
vec2 receiver_gradient(ShadowMap map, vec3 normal, float n_dot_l, float distance)
{
    vec3 forward = map.row_w.xyz; // 0 in orthographic maps, whose rows have nothing of it
    float along = dot(normal, forward);
    vec2 aside = vec2(dot(normal, map.row_x.xyz) - along * dot(forward, map.row_x.xyz),
                      dot(normal, map.row_y.xyz) - along * dot(forward, map.row_y.xyz));
    return -map.texel * map.texel * aside / (max(n_dot_l, 0.02) * distance);
}

/**
 * Whether a caster is before a receiver of this nearness, `offset` texels from where the caster is known.
 *
 * Only what is before the receiver by both planes hides it: the caster's, at the receiver's place, and the receiver's, at
 * the caster's. So neither a tilted surface nor a neighbouring facet shadows what it touches.
 */
bool hides(vec3 caster, vec2 offset, float nearness, vec2 gradient, float tolerance)
{
    float before = min(dot(caster.yz, offset), dot(gradient, offset));
    float allowance = tolerance + SUBPIXEL * (abs(caster.y) + abs(caster.z) + abs(gradient.x) + abs(gradient.y));
    return caster.x > 0.0 && caster.x + before > nearness + allowance;
}

/** The same of the caster in a texel and a receiver at `point`, in map space. */
bool texel_hides(ShadowMap map, ivec2 texel, vec3 point, vec2 gradient, float tolerance)
{
    return hides(fetch_caster(map, texel), point.xy - (vec2(texel) + 0.5), point.z, gradient, tolerance);
}

/** The map that a receiver is on, and its place there; false where no map shows it, so that light arrives. */
bool find_map(LightPoint point, vec3 origin, vec3 position, out ShadowMap map, out vec3 place)
{
    if (point.shadow_count < 0) {
        vec3 away = position - origin;
        vec3 size = abs(away);
        int axis = size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
        map = fetch_shadow_map(point.shadow_first + 2 * axis + (away[axis] < 0.0 ? 1 : 0));
        place = to_map(map, position);
        return map.size > 0.0;
    }
    for (int index = 0; index < point.shadow_count; ++index) {
        map = fetch_shadow_map(point.shadow_first + index);
        if (map.size == 0.0)
            continue;
        place = to_map(map, position);
        // Behind a perspective map's light nothing is lit. What is aside of it, at the rim of a spot's cone, where a
        // sphere's point is seen in a slightly other direction than that in which it is sampled, has its nearest texel.
        if (place.z > 0.0 && (!map.orthographic || on_map(map, place.xy, 1.0)))
            return true;
    }
    return false;
}

/** The nearest texel of a map. */
ivec2 texel_of(ShadowMap map, vec2 point)
{
    return ivec2(clamp(point, map.corner, map.corner + map.size - 1.0));
}

// Texels within which a caster must come to a receiver that it meets in a crease.
const float CONTACT = 2.0;

/**
 * Whether the caster in texel `nearest` hides a receiver, or one in the four texels about it that it meets in a crease.
 *
 * Beside a crease the nearest texel may be beyond the other surface's edge, where the light goes on behind the receiver:
 * what covers it is in the next texel. Where the nearest one shows the receiver itself, or the caster is farther off,
 * that does not count: edges of ordinary shadows stay where they are. Without a nearest texel (below 0) all count.
 */
bool is_hidden(ShadowMap map, ivec2 nearest, vec3 point, vec2 gradient, float tolerance, float distance)
{
    float texel_depth = nearness_of(map, point.z, map.texel * distance);
    ivec2 first = texel_of(map, point.xy - 0.5);
    ivec2 last = texel_of(map, vec2(first) + 1.5);
    bool hidden = false, beyond = nearest.x < 0, covered = false;
    for (int index = 0; index < 4; ++index) {
        ivec2 texel = ivec2(index % 2 == 0 ? first.x : last.x, index / 2 == 0 ? first.y : last.y);
        vec2 offset = point.xy - (vec2(texel) + 0.5);
        vec3 caster = fetch_caster(map, texel);
        float change = dot(caster.yz, offset);
        bool hides_it = hides(caster, offset, point.z, gradient, tolerance);
        bool meets = caster.x + change - point.z < CONTACT * (texel_depth + abs(caster.y) + abs(caster.z));
        if (texel == nearest) {
            hidden = hides_it;
            beyond = caster.x + max(change, dot(gradient, offset)) < point.z - tolerance;
        }
        covered = covered || (meets && hides_it);
    }
    return hidden || (beyond && covered);
}

/** 1 where light from a sampled point (`origin`; of distant light unused) arrives, else 0. */
float point_visibility(LightPoint point, vec3 origin, Receiver receiver, float n_dot_l)
{
    ShadowMap map;
    vec3 place;
    if (!find_map(point, origin, receiver.position, map, place))
        return 1.0;
    // Samples of a light that always has the same map round to its texels elsewhere each: its edges become smooth.
    ivec2 nearest = texel_of(map, place.xy + (point.is_fixed ? shadow_jitter : vec2(0.0)));
    float distance = map.orthographic ? 1.0 : length(receiver.position - origin);
    vec2 gradient = receiver_gradient(map, receiver.normal, n_dot_l, distance);
    float tolerance = receiver_tolerance(map, receiver, place.z, n_dot_l);
    return is_hidden(map, nearest, place, gradient, tolerance, distance) ? 0.0 : 1.0;
}

#ifdef PREVIEW
const int BLOCKER_TAPS = 12;
const int FILTER_TAPS = 20;
// A search wider than this share of the map would find casters of other shadows.
const float WIDEST_SEARCH = 0.1;
// Casters nearer to the light than this share of the way are searched for less widely than they shadow.
const float NEAREST_BLOCKER = 0.3;

/** Taps that fill the unit disk evenly, turned by `turn` (Vogel's spiral). */
vec2 disk_tap(int index, int count, float turn)
{
    float angle = 2.39996323 * float(index) + turn;
    return sqrt((float(index) + 0.5) / float(count)) * vec2(cos(angle), sin(angle));
}

/**
 * Share of a light of radius `radius` (m; of distant light the tangent of its angular radius) that a receiver sees: its
 * blockers' mean distance gives the penumbra's width (Fernando 2005, "Percentage-Closer Soft Shadows").
 */
float soft_visibility(LightPoint point, vec3 origin, float radius, Receiver receiver, float n_dot_l, float turn)
{
    ShadowMap map;
    vec3 place;
    if (!find_map(point, origin, receiver.position, map, place))
        return 1.0;
    float distance = map.orthographic ? 1.0 : length(receiver.position - origin);
    vec2 gradient = receiver_gradient(map, receiver.normal, n_dot_l, distance);
    float scale = radius / map.texel;
    // Rays to the light's rim pass a blocker of nearness n at (n - n of the receiver) times this, in texels.
    float widest = map.orthographic ? map.size * map.texel : place.z * (1.0 / NEAREST_BLOCKER - 1.0);
    float search = clamp(scale * widest, 1.0, WIDEST_SEARCH * map.size);
    float tolerance = receiver_tolerance(map, receiver, place.z, n_dot_l);
    if (is_hidden(map, ivec2(-1), place, gradient, tolerance, distance)) // in a crease: no tap need be in it
        return 0.0;
    float blockers = 0.0, nearness = 0.0;
    for (int tap = 0; tap < BLOCKER_TAPS; ++tap) {
        vec2 offset = search * disk_tap(tap, BLOCKER_TAPS, turn);
        ivec2 texel = texel_of(map, place.xy + offset);
        vec3 there = vec3(place.xy + offset, place.z + dot(gradient, offset));
        if (texel_hides(map, texel, there, gradient, tolerance)) {
            blockers += 1.0;
            nearness += fetch_caster(map, texel).x;
        }
    }
    if (blockers == 0.0)
        return 1.0;
    float penumbra = clamp(scale * max(nearness / blockers - place.z, 0.0), 0.75, WIDEST_SEARCH * map.size);
    float lit = 0.0;
    for (int tap = 0; tap < FILTER_TAPS; ++tap) {
        vec2 offset = penumbra * disk_tap(tap, FILTER_TAPS, turn);
        vec3 there = vec3(place.xy + offset, place.z + dot(gradient, offset));
        lit += texel_hides(map, texel_of(map, there.xy), there, gradient, tolerance) ? 0.0 : 1.0;
    }
    return lit / float(FILTER_TAPS);
}
#endif
