// SPDX-License-Identifier: GPL-3.0-or-later
// Nearest and farthest view depth (m) of each tile of one layer; where all of a tile is empty, (+inf, -inf).

#include "generated/DepthTilesUniforms.glsl"

uniform sampler2DArray view_depth_layers;

layout(location = 0) out vec2 out_range;

void main()
{
    ivec2 first = ivec2(gl_FragCoord.xy) * TILE_SIZE;
    ivec2 end = min(first + TILE_SIZE, textureSize(view_depth_layers, 0).xy);
    float infinity = uintBitsToFloat(0x7F800000u);
    float nearest = infinity;
    float farthest = -infinity;
    for (int y = first.y; y < end.y; ++y)
        for (int x = first.x; x < end.x; ++x) {
            float view_depth = texelFetch(view_depth_layers, ivec3(x, y, layer), 0).r;
            nearest = min(nearest, view_depth);
            farthest = isinf(view_depth) ? farthest : max(farthest, view_depth);
        }
    out_range = vec2(nearest, farthest);
}
