// SPDX-License-Identifier: GPL-3.0-or-later
// Faces' planes, colours and emission from what their points added up.

#include "radiance_grid/plane.glsl"

uniform sampler2D sum_base_color;
uniform sampler2D sum_offset;
uniform sampler2D sum_normal;
uniform sampler2D sum_emission;
uniform sampler2D most;
uniform sampler2D least;

layout(location = 0) out uvec4 out_plane;
layout(location = 1) out vec4 out_point;
layout(location = 2) out vec4 out_albedo;
layout(location = 3) out vec4 out_emission;

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 base_color = texelFetch(sum_base_color, texel, 0);
    float area = max(base_color.a, 1e-37);
    vec3 normal = texelFetch(sum_normal, texel, 0).xyz;
    normal /= max(length(normal), 1e-37);
    vec3 offset = texelFetch(sum_offset, texel, 0).xyz / area;
    vec3 low = 0.5 - texelFetch(least, texel, 0).xyz, high = texelFetch(most, texel, 0).xyz - 0.5;
    out_plane = encode_plane(Plane(normal, dot(normal, offset), low - HALF_SPACING, high + HALF_SPACING));
    out_point = vec4(offset, base_color.a);
    out_albedo = vec4(base_color.rgb / area, 1.0);
    out_emission = vec4(texelFetch(sum_emission, texel, 0).rgb / area, 0.0);
}
