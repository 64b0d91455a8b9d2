// SPDX-License-Identifier: GPL-3.0-or-later
// Gathered irradiance blended with what earlier samples and, in a viewport, earlier views found on the same surface.
//
// Sample i, which gathered G, becomes M + (i + 1)/(L + i + 1) (G − M), where M is the mean of the L samples of history and
// the i samples before. Then the film, a mean of blended samples, holds the mean of all L + i + 1: the share of history
// falls as samples accumulate, and the film tends to the mean of what was gathered.

#include "generated/TemporalUniforms.glsl"
#include "common/camera.glsl"
#include "common/finite.glsl"
#include "common/gather.glsl"
#include "common/luminance.glsl"
#include "common/octahedral.glsl"
#include "common/same_surface.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;
uniform sampler2DArray motion_layers;
uniform sampler2DArray found; // irradiance (W/m²) of this sample, variance of its luminance
uniform sampler2DArray history; // the mean of earlier ones, its variance
uniform sampler2DArray history_surfaces; // octahedral normal (world), view depth (m), number of samples; 0 where none

layout(location = 0) out vec4 out_blended;
layout(location = 1) out vec4 out_history;
layout(location = 2) out vec4 out_surface;

#ifdef REPROJECT
// Samples that history counts for at most, so that light that changed is followed.
const float LONGEST_HISTORY = 16.0;
// Standard deviations from the mean of its neighbours that a texel's irradiance may be away.
const float CREDIBLE = 2.0;
#endif

/** What a texel looks at, and from which pixel: unit normal (world), view depth (m), +inf where empty. */
struct Seen {
    ivec2 pixel;
    vec3 normal;
    float view_depth;
};

/** What the texel of the gathered target looks at. */
Seen seen_by(ivec2 texel)
{
    ivec2 pixel = gathered_pixel(texel);
    vec3 normal = decode_octahedral(texelFetch(normal_layers, ivec3(pixel, 0), 0).rg);
    return Seen(pixel, normal, texelFetch(view_depth_layers, ivec3(pixel, 0), 0).r);
}

/** Mean irradiance of earlier samples and its variance; how many they were, 0 where there are none to be used. */
struct History {
    vec4 mean;
    float samples;
};

/** A surface as the history's camera saw it; `pixel` with the centres of pixels at 0.5. `tolerance`: m. */
struct Past {
    SurfacePlane plane;
    vec3 normal; // world
    vec2 pixel;
    float tolerance;
};

/** Size of a pixel in the history's window. */
vec2 history_pixel_size()
{
    return (history_window.yw - history_window.xz) / camera_resolution;
}

/** Where a surface was in the history's camera; its plane's view depth is not positive where that did not see it. */
Past past_of(Seen seen)
{
    bool perspective = camera_orthographic == 0;
    vec2 centre = vec2(seen.pixel) + 0.5;
    vec4 position = history_from_relative * vec4(relative_position(centre, seen.view_depth), 1.0);
    float view_depth = -position.z;
    vec2 size = history_pixel_size();
    vec2 at_rest = (position.xy / (perspective ? view_depth : 1.0) - history_window.xz) / size;
#ifdef REPROJECT
    vec2 pixel = centre - texelFetch(motion_layers, ivec3(seen.pixel, 0), 0).rg;
#else
    vec2 pixel = at_rest;
#endif
    vec3 normal = mat3(history_from_relative) * seen.normal;
    SurfacePlane plane = surface_plane(normal, view_depth, history_window.xz + pixel * size, size, perspective);
    // What moved of itself may have moved as far along the view as across it.
    float pixels = float(gather_divisor) + distance(pixel, at_rest);
    float width = max(abs(size.x), abs(size.y)) * (perspective ? view_depth : 1.0);
    return Past(plane, seen.normal, pixel, pixels * width);
}

/** A texel's history, weighted: 0…`share` by whether it is of the given surface. */
void add_history(ivec2 texel, float share, Past past, inout History sum, inout float total)
{
    ivec3 place = ivec3(texel, 0);
    vec4 surface = texelFetch(history_surfaces, place, 0), mean = texelFetch(history, place, 0);
    vec2 pixel = min(vec2(texel * gather_divisor) + history_offset, camera_resolution - 1.0) + 0.5;
    float off_plane = plane_distance(past.plane, pixel - past.pixel, surface.z);
    float weight = share * normal_weight(past.normal, decode_octahedral(surface.xy))
        * plane_weight(off_plane, past.tolerance);
    if (weight > 0.0 && surface.w >= 1.0 && is_finite(surface) && is_finite(mean)) {
        sum.mean += vec4(weight * mean.rgb, weight * weight * mean.a);
        sum.samples += weight * surface.w;
        total += weight;
    }
}

/** What is known of a surface from earlier samples. */
History history_of(ivec2 texel, Seen seen)
{
    History sum = History(vec4(0.0), 0.0);
    float total = 0.0;
    Past past = past_of(seen);
    if (history_known == 0 || !(past.plane.view_depth > 0.0))
        return sum;
#ifdef REPROJECT
    vec2 place = (past.pixel - 0.5 - history_offset) / float(gather_divisor);
    ivec2 corner = ivec2(floor(clamp(place, vec2(-2.0), vec2(65536.0)))), last = textureSize(history, 0).xy - 1;
    vec2 beyond = place - vec2(corner);
    for (int i = 0; i < 4; i++) {
        ivec2 offset = ivec2(i & 1, i >> 1), other = corner + offset;
        vec2 share = mix(1.0 - beyond, beyond, vec2(offset));
        if (all(greaterThanEqual(other, ivec2(0))) && all(lessThanEqual(other, last)))
            add_history(other, share.x * share.y, past, sum, total);
    }
#else
    add_history(texel, 1.0, past, sum, total);
#endif
    if (total > 0.0)
        sum = History(sum.mean / vec2(total, total * total).xxxy, sum.samples / total);
    return sum;
}

#ifdef REPROJECT
/**
 * History within what the neighbours of the same surface found (variance clipping: Salvi 2016, "An Excursion in
 * Temporal Supersampling"); as much as it had to be moved, it counts for fewer samples.
 */
History credible(History old, ivec2 texel, Seen seen)
{
    vec2 pixel_size = (camera_window.yw - camera_window.xz) / camera_resolution;
    mat3 camera_from_world = transpose(mat3(world_from_camera));
    SurfacePlane plane = surface_plane(camera_from_world * seen.normal, seen.view_depth,
                                       window_point(vec2(seen.pixel) + 0.5), pixel_size, camera_orthographic == 0);
    float tolerance = float(gather_divisor) * pixel_width(seen.view_depth);
    vec4 mean = vec4(0.0);
    vec3 squares = vec3(0.0);
    float total = 0.0;
    ivec2 last = textureSize(found, 0).xy - 1;
    for (int i = 0; i < 9; i++) {
        ivec2 other = texel + ivec2(i % 3, i / 3) - 1;
        if (any(lessThan(other, ivec2(0))) || any(greaterThan(other, last)))
            continue;
        Seen beside = seen_by(other);
        float off_plane = plane_distance(plane, vec2(beside.pixel - seen.pixel), beside.view_depth);
        float weight = normal_weight(seen.normal, beside.normal) * plane_weight(off_plane, tolerance);
        vec4 value = texelFetch(found, ivec3(other, 0), 0);
        if (weight > 0.0 && is_finite(value)) {
            mean += weight * value;
            squares += weight * value.rgb * value.rgb;
            total += weight;
        }
    }
    if (!(total > 0.0))
        return History(vec4(0.0), 0.0);
    mean /= total;
    // Differences between the neighbours, and the noise of each, whose share in a channel is as that of its light.
    vec3 spread = max(squares / total - mean.rgb * mean.rgb, 0.0);
    vec3 noise = mean.rgb / max(luminance(mean.rgb), 1e-30);
    vec3 range = CREDIBLE * sqrt(spread + mean.a * noise * noise);
    vec3 away = old.mean.rgb - mean.rgb;
    vec3 believed = min(range / max(abs(away), 1e-30), 1.0);
    old.samples *= min(min(believed.r, believed.g), believed.b);
    old.mean.rgb = mean.rgb + clamp(away, -range, range);
    return old;
}
#endif

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec3 place = ivec3(texel, 0);
    Seen seen = seen_by(texel);
    vec4 now = texelFetch(found, place, 0);
    bool covered = !isinf(seen.view_depth), usable = covered && is_finite(now);
    History old = History(vec4(0.0), 0.0);
    if (covered)
        old = history_of(texel, seen);
#ifdef REPROJECT
    if (old.samples > 0.0)
        old = credible(old, texel, seen);
    old.samples = min(old.samples, LONGEST_HISTORY);
    float before = old.samples;
#else
    float before = max(old.samples - float(sample_index), 0.0);
#endif
    float found_share = usable ? 1.0 : 0.0;
    vec4 kept = usable ? now : vec4(0.0);
    if (old.samples > 0.0) {
        float film_share = found_share * float(sample_index + 1) / (before + float(sample_index + 1));
        float mean_share = found_share / (old.samples + 1.0);
        vec4 film_shares = vec2(film_share, film_share * film_share).xxxy;
        vec4 rest = vec2(1.0 - film_share, (1.0 - film_share) * (1.0 - film_share)).xxxy;
        out_blended = rest * old.mean + film_shares * kept;
        vec4 mean_shares = vec2(mean_share, mean_share * mean_share).xxxy;
        rest = vec2(1.0 - mean_share, (1.0 - mean_share) * (1.0 - mean_share)).xxxy;
        out_history = rest * old.mean + mean_shares * kept;
    } else {
        out_blended = out_history = kept;
    }
#ifdef REPROJECT
    out_surface = vec4(encode_octahedral(seen.normal), seen.view_depth, old.samples + found_share);
    if (!covered || out_surface.w < 1.0)
        out_history = out_surface = vec4(0.0);
#else
    // A texel's history is of the surface that the view's first sample met.
    out_surface = texelFetch(history_surfaces, place, 0);
    if (old.samples > 0.0)
        out_surface.w += found_share;
    else
        out_history = texelFetch(history, place, 0);
#endif
}
