// SPDX-License-Identifier: GPL-3.0-or-later
// Which of a page of lights may reach any surface of each tile of one layer: one bit each. None that does is ever missing.

#include "common/camera.glsl"
#include "common/light_reach.glsl"
#include "generated/LightTilesUniforms.glsl"

// Share of the distances involved by which tests err towards a light: what roundings make of them, here and where it is
// used, and of the angle of the narrowest cones.
const float ROUNDING = 1e-4;

uniform sampler2DArray tile_depth_layers;

layout(location = 0) out uvec4 out_lights;

/** The piece of the view frustum that holds a tile's surfaces, in camera space. */
struct Slab
{
    vec2 low;       // the tile's edges in the window
    vec2 high;
    vec3 near;      // ends of the line through its middle
    vec3 far;
    float radius;   // m: no point of it is farther from that line
};

Slab make_slab(vec2 depths)
{
    vec2 first = window_point(floor(gl_FragCoord.xy) * float(TILE_SIZE));
    vec2 last = window_point(min(ceil(gl_FragCoord.xy) * float(TILE_SIZE), camera_resolution));
    Slab slab = Slab(min(first, last), max(first, last), vec3(0.0), vec3(0.0), 0.5 * distance(first, last));
    vec2 middle = 0.5 * (first + last);
    bool orthographic = camera_orthographic != 0;
    slab.near = vec3(orthographic ? middle : middle * depths.x, -depths.x);
    slab.far = vec3(orthographic ? middle : middle * depths.y, -depths.y);
    slab.radius *= orthographic ? 1.0 : depths.y;
    return slab;
}

/** Distance from a point to a line between two others. */
float segment_distance(vec3 point, vec3 start, vec3 end)
{
    vec3 along = end - start;
    float share = dot(point - start, along) / max(dot(along, along), 1e-30);
    return distance(point, start + clamp(share, 0.0, 1.0) * along);
}

/** Whether a ball touches the wedge between the planes through the tile's edges. */
bool touches_sides(vec3 center, float radius, Slab slab)
{
    float perspective = camera_orthographic != 0 ? 0.0 : 1.0;
    float scale = camera_orthographic != 0 ? 1.0 : -center.z;
    vec2 beyond_low = (slab.low * scale - center.xy) * inversesqrt(1.0 + perspective * slab.low * slab.low);
    vec2 beyond_high = (center.xy - slab.high * scale) * inversesqrt(1.0 + perspective * slab.high * slab.high);
    return !(any(greaterThan(beyond_low, vec2(radius))) || any(greaterThan(beyond_high, vec2(radius))));
}

/**
 * Whether a ball about the slab touches what a spot light can light: all between its cone, moved to any point of the
 * light. The cone lies within the half space along its axis, and within any half space that its side lies on.
 */
bool touches_cone(Light light, vec3 axis, vec3 center, vec3 middle, float radius)
{
    vec3 offset = middle - center;
    float along = dot(offset, axis);
    float aside = length(offset - along * axis);
    float sine = sqrt(max(1.0 - light.cone_cosine * light.cone_cosine, 0.0));
    return !(max(-along, light.cone_cosine * aside - sine * along) > radius + light.radius);
}

bool may_reach(int index, Slab slab)
{
    float reach_squared = light_reach_squared(index);
    if (isinf(reach_squared))
        return true;
    Light light = fetch_light(index);
    mat3 world_axes = mat3(world_from_camera);
    vec3 center = light.position * world_axes;
    vec3 axis = light.axis * world_axes;
    float rounding = ROUNDING * (length(center) + length(slab.far) + slab.radius);
    float reach = sqrt(reach_squared) + rounding;
    if (segment_distance(center, slab.near, slab.far) > reach + slab.radius || !touches_sides(center, reach, slab))
        return false;
    if (light.kind == LIGHT_AREA) // shines to one side of its plane
        return !(max(dot(slab.near - center, axis), dot(slab.far - center, axis)) < -(slab.radius + rounding));
    float ball = 0.5 * distance(slab.near, slab.far) + slab.radius + rounding;
    return light.kind != LIGHT_SPOT || touches_cone(light, axis, center, 0.5 * (slab.near + slab.far), ball);
}

void main()
{
    out_lights = uvec4(0u);
    vec2 depths = texelFetch(tile_depth_layers, ivec3(gl_FragCoord.xy, layer), 0).rg;
    if (depths.x > depths.y)
        return;
    Slab slab = make_slab(depths);
    for (int word = 0; word < 4; ++word) {
        int first = LIGHTS_PER_PAGE * page + 32 * word;
        int count = clamp(light_count - first, 0, 32);
        uint bits = 0u;
        for (int bit = 0; bit < count; ++bit)
            bits |= may_reach(first + bit, slab) ? 1u << bit : 0u;
        out_lights[word] = bits;
    }
}
