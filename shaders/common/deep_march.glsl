// SPDX-License-Identifier: GPL-3.0-or-later
// Rays marched through the layers of the deep G-buffer, on the screen. Positions are relative (camera.glsl), in metres.
// LAYERS n: how many layers there are. EXIT: where solids end is known.

#include "common/camera.glsl"
#include "common/constants.glsl"

uniform sampler2DArray view_depth_layers;
#ifdef EXIT
uniform sampler2DArray exit_view_depth_layers;
#endif

/**
 * What a ray met. `hit`: a layer; `layer` and `pixel` (of the whole guarded picture) of what it met, and `distance` (m)
 * to it. Otherwise `distance` is how far nothing was met; `ended`: whether that is because the screen ends; `hidden`:
 * whether it is behind the nearest layer there, where something unseen may be in its way.
 */
struct MarchHit
{
    bool hit;
    bool ended;
    bool hidden;
    float distance;
    int layer;
    ivec2 pixel;
};

// Farther (m) than anything, and far from overflow.
const float FARTHEST = 1e30;

/**
 * Where a ray from a surface must begin in order not to meet that surface itself: at a texel the surface was seen up to
 * half the diagonal of a pixel away from where a ray passes, so it rises as far above the surface along its normal.
 */
vec3 march_origin(vec3 position, vec3 normal, float view_depth)
{
    float rounding = 4.0 * FLOAT_EPSILON * (abs(position.x) + abs(position.y) + abs(position.z));
    return position + normal * (sqrt(0.5) * pixel_width(view_depth) + rounding);
}

/** How far (m) a ray (x, y and depth in camera space) stays on the screen. */
float distance_on_screen(vec3 start, vec3 way)
{
    // Of the window's edges: how far the start is inside, and how fast the ray comes nearer, both in metres at depth 1.
    float begin = camera_orthographic != 0 ? 1.0 : start.z;
    float widening = camera_orthographic != 0 ? 0.0 : way.z;
    vec4 side = vec4(1.0, -1.0, 1.0, -1.0);
    vec4 inside = side * (start.xxyy - camera_window * begin);
    vec4 approach = side * (camera_window * widening - way.xxyy);
    vec4 distances = max(inside, 0.0) / max(approach, 1.0 / FARTHEST);
    distances = mix(vec4(FARTHEST), distances, greaterThan(approach, vec4(0.0)));
    float edge = min(min(distances.x, distances.y), min(distances.z, distances.w));
    // The edges meet in the eye: before it, where half the digits of the depth are left.
    bool comes_near = camera_orthographic == 0 && way.z < 0.0;
    return comes_near ? min(edge, (1.0 - sqrt(FLOAT_EPSILON)) * start.z / -way.z) : edge;
}

/**
 * Where on the screen a ray is: a fraction s of the way from its start to its end. Depth and distance are fractions
 * that have a denominator in common, for in perspective it is their ratio to depth that is linear on the screen.
 */
struct MarchedRay
{
    vec2 start;      // pixels
    vec2 way;        // pixels, to the end
    vec2 depth;      // m at s = 0 and 1, before division
    vec2 divisor;    // at s = 0 and 1
    float distance;  // m at s = 1, before division
};

/** The part of a ray (x, y and depth in camera space) up to `end` metres; all of it must be on the screen. */
MarchedRay marched_ray(vec3 start, vec3 way, float end)
{
    bool parallel = camera_orthographic != 0;
    MarchedRay ray;
    vec2 pixels = camera_resolution / (camera_window.yw - camera_window.xz);
    // Of the end, all over its distance, which may be as good as infinite.
    vec3 last = start / end + way;
    float nearness = parallel ? end : 1.0 / max(last.z, 1.0 / FARTHEST);
    vec2 from = parallel ? start.xy : start.xy / start.z;
    vec2 to = last.xy * nearness;
    ray.start = (from - camera_window.xz) * pixels;
    ray.way = (to - from) * pixels;
    ray.depth = parallel ? vec2(start.z, last.z * end) : vec2(1.0);
    ray.divisor = parallel ? vec2(1.0) : vec2(1.0 / start.z, nearness / end);
    ray.distance = nearness;
    return ray;
}

/**
 * Between which view depths (m) each layer at a pixel is solid: to its exit surface, where no other layer comes before
 * that. What has no back, or without EXIT anything, is a sheet: as thick as so many pixels are wide, at most. A layer
 * that shows the back of the one before, which is no surface to enter by, begins where that one does and ends at once.
 */
void layer_slabs(ivec2 pixel, float pixels, out float begin[LAYERS], out float end[LAYERS])
{
    float next = FARTHEST;
    for (int k = LAYERS - 1; k >= 0; --k) {
        float view_depth = texelFetch(view_depth_layers, ivec3(pixel, k), 0).r;
        begin[k] = view_depth;
        end[k] = min(view_depth + pixels * pixel_width(view_depth), next);
#ifdef EXIT
        float leaves = texelFetch(exit_view_depth_layers, ivec3(pixel, k), 0).r;
        float rounding = 4.0 * FLOAT_EPSILON * next;
        end[k] = leaves > next + rounding ? end[k] : leaves;
        int farther = min(k + 1, LAYERS - 1);
        bool back = abs(leaves - next) <= rounding;
        begin[farther] = back ? view_depth : begin[farther];
        end[farther] = back ? -FARTHEST : end[farther];
#endif
        next = min(view_depth, FARTHEST);
    }
}

/**
 * Whether a ray, at view depth `before` (m) at the step before, was in front of the surface that layer k now shows.
 *
 * `was`, `is`: view depths of the layers' surfaces (m) then and now. A surface goes on in the same layer where that is
 * nearer to what it was than the next layer is; otherwise an occluder came before it, and it goes on in the next layer;
 * or one went away, and it goes on in the layer before.
 */
bool went_through(float before, float was[LAYERS], float is[LAYERS], int k)
{
    int nearer = max(k - 1, 0), farther = min(k + 1, LAYERS - 1);
    float change = abs(is[k] - was[k]);
    return (before < was[k] && change < abs(is[farther] - was[k]))
           || (before < was[nearer] && abs(is[k] - was[nearer]) < abs(is[nearer] - was[nearer]))
           || (before < was[farther] && abs(is[k] - was[farther]) < change);
}

/**
 * The first of the layers that a ray enters.
 *
 * `origin`: relative position (m), off the surface as `march_origin` says; `direction`: unit vector, world axes;
 * `reach` (m): how far to look; `steps` ≥ 1: how often at most, each time at least a pixel farther, more densely near
 * the origin; `jitter` in [0, 1) moves them, but the last is always at the end of the way.
 *
 * A ray enters a layer where it is behind its surface at a step, if it was not behind all of the slab at the step
 * before; or if it was in front of that surface then, see `went_through`.
 */
MarchHit deep_march(vec3 origin, vec3 direction, float reach, int steps, float jitter)
{
    vec3 start = (origin * mat3(world_from_camera)) * vec3(1.0, 1.0, -1.0);
    vec3 way = (direction * mat3(world_from_camera)) * vec3(1.0, 1.0, -1.0);
    float screen = distance_on_screen(start, way);
    float farthest = min(reach, screen);
    MarchedRay ray = marched_ray(start, way, farthest);
    MarchHit hit = MarchHit(false, screen < reach, false, farthest, 0, ivec2(0));

    float pixels = max(abs(ray.way.x), abs(ray.way.y));
    float count = clamp(ceil(pixels), 1.0, float(steps));
    // The steps' share of the way if each were a pixel wide; the rest of it grows with the square.
    float even = min(count / max(pixels, 1.0), 1.0);
    ivec2 last_pixel = ivec2(camera_resolution) - 1;
    float before = start.z;
    // Where it starts, all that is known is the surface that it starts from.
    float was[LAYERS];
    for (int k = 0; k < LAYERS; ++k)
        was[k] = k == 0 ? start.z + 4.0 * FLOAT_EPSILON * abs(start.z) : -FARTHEST;
    for (float taken = 1.0; taken <= count && !hit.hit; taken += 1.0) {
        float u = (taken - jitter) / (count - jitter);
        float s = u * mix(u, 1.0, even);
        vec2 parts = vec2(1.0 - s, s);
        float scale = 1.0 / dot(ray.divisor, parts);
        float depth = dot(ray.depth, parts) * scale;
        ivec2 pixel = clamp(ivec2(ray.start + s * ray.way), ivec2(0), last_pixel);
        float begin[LAYERS], end[LAYERS];
        // What may slip through between this step and the next: what is thinner than they are apart.
        layer_slabs(pixel, pixels * mix(2.0 * u, 1.0, even) / count, begin, end);
        for (int k = 0; k < LAYERS; ++k) {
            bool entered = min(before, depth) <= end[k] || went_through(before, was, begin, k);
            if (!hit.hit && begin[k] < depth && entered)
                hit = MarchHit(true, false, false, s * ray.distance * scale, k, pixel);
        }
        hit.hidden = !hit.hit && begin[0] < depth;
        before = depth;
        was = begin;
    }
    return hit;
}
