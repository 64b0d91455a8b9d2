// SPDX-License-Identifier: GPL-3.0-or-later
// Where the passes that light layers write; with SPLIT what leaves diffusely and specularly by itself as well.

#include "common/finite.glsl"

layout(location = 0) out vec4 out_radiance;
#ifdef SPLIT
layout(location = 1) out vec4 out_diffuse;
layout(location = 2) out vec4 out_glossy;
#endif

/** Write the radiance that a texel emits and reflects, W/(sr·m²). `coverage`: 1 where there is a surface, else 0. */
void write_radiance(vec3 emitted, vec3 diffuse, vec3 glossy, float coverage)
{
    out_radiance = vec4(finite_radiance(emitted + diffuse + glossy), coverage);
#ifdef SPLIT
    out_diffuse = vec4(finite_radiance(diffuse), 1.0);
    out_glossy = vec4(finite_radiance(glossy), 1.0);
#endif
}
