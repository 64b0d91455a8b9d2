// SPDX-License-Identifier: GPL-3.0-or-later
// What an earlier grid's points added up, for faces whose cells hold the same surfaces as then.

#include "radiance_grid/table.glsl"
#include "generated/FaceUniforms.glsl"

uniform usampler2D face_sources; // number of the earlier grid's face plus 1, 0 where there is none
uniform sampler2D sum_base_color;
uniform sampler2D sum_offset;
uniform sampler2D sum_normal;
uniform sampler2D sum_emission;
uniform sampler2D most;
uniform sampler2D least;

layout(location = 0) out vec4 out_base_color;
layout(location = 1) out vec4 out_offset;
layout(location = 2) out vec4 out_normal;
layout(location = 3) out vec4 out_emission;
layout(location = 4) out vec4 out_most;
layout(location = 5) out vec4 out_least;

void main()
{
    int face = int(gl_FragCoord.y) * FACES_PER_ROW + int(gl_FragCoord.x);
    if (face < first_face || face >= end_face)
        discard;
    uint source = texelFetch(face_sources, face_texel(face), 0).r;
    if (source == 0u)
        discard;
    ivec2 earlier = face_texel(int(source) - 1);
    out_base_color = texelFetch(sum_base_color, earlier, 0);
    out_offset = texelFetch(sum_offset, earlier, 0);
    out_normal = texelFetch(sum_normal, earlier, 0);
    out_emission = texelFetch(sum_emission, earlier, 0);
    out_most = texelFetch(most, earlier, 0);
    out_least = texelFetch(least, earlier, 0);
}
