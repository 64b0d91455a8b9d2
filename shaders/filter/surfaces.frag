// SPDX-License-Identifier: GPL-3.0-or-later
// What the gathered texels look at, fetched and decoded once for all steps of the filter.

#include "generated/FilterUniforms.glsl"
#include "common/camera.glsl"
#include "common/finite.glsl"
#include "common/gather.glsl"
#include "common/octahedral.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;
uniform sampler2DArray unfiltered;

layout(location = 0) out vec4 out_surface; // camera-space normal, view depth (m); all 0 where no light is to be taken

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    ivec3 pixel = ivec3(gathered_pixel(texel), 0);
    float view_depth = texelFetch(view_depth_layers, pixel, 0).r;
    vec3 normal = decode_octahedral(texelFetch(normal_layers, pixel, 0).rg) * mat3(world_from_camera);
    vec4 gathered = texelFetch(unfiltered, ivec3(texel, 0), 0);
    bool usable = !isinf(view_depth) && is_finite(gathered);
    out_surface = usable ? vec4(normal, view_depth) : vec4(0.0);
}
