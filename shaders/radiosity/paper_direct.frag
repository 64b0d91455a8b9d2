// SPDX-License-Identifier: GPL-3.0-or-later
// What the authors' composite leaves of the nearest layer's direct light; the target is multiplied by it.

#include "common/camera.glsl"
#include "common/octahedral.glsl"
#include "generated/RadiosityUniforms.glsl"
#include "common/gather.glsl"

uniform sampler2DArray view_depth_layers;
uniform sampler2DArray normal_layers;

#include "common/screen_taps.glsl"
#include "radiosity/paper.glsl"

layout(location = 0) out vec4 out_factor;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float view_depth = texelFetch(view_depth_layers, ivec3(pixel, 0), 0).r;
    out_factor = vec4(1.0);
    if (isinf(view_depth))
        return;
    vec3 position = relative_position(gl_FragCoord.xy, view_depth);
    vec3 normal = decode_octahedral(texelFetch(normal_layers, ivec3(pixel, 0), 0).rg);
    Obscurance found = obscurance(pixel, pixel, position, normal, view_depth, OBSCURANCE_SHARE * tap_radius);
    out_factor.rgb = vec3(paper_direct_factor(found));
}
