// SPDX-License-Identifier: GPL-3.0-or-later
// Hardware depth for drivers without a 0…1 clip space.

#include "generated/GBufferUniforms.glsl"

/** Depth 1 at the near plane, falling to 0: what a 0…1 clip space stores without this (`Camera.projection`). */
float reversed_depth(float view_depth)
{
    return orthographic != 0 ? (clip_end - view_depth) / (clip_end - clip_start) : clip_start / view_depth;
}
