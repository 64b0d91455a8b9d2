// SPDX-License-Identifier: GPL-3.0-or-later
// What a point adds to its face: everything times the area that it stands for.

#include "common/finite.glsl"
#include "generated/GridPointsUniforms.glsl"
#include "generated/MaterialUniforms.glsl"

#ifdef TEXTURE
uniform sampler2D base_color_texture;
#endif

flat in vec3 offset;
flat in vec3 normal;
#ifndef OCCUPANCY
flat in float area;
flat in vec3 low;
flat in vec3 high;
#endif
#ifdef TEXTURE
flat in vec2 uv;
flat in float uv_scale;
#endif
#ifdef ATTRIBUTE
flat in vec3 color;
#endif
#ifdef EMISSION
flat in vec2 glow;
#endif

#ifdef OCCUPANCY
layout(location = 0) out float out_there;
#else
layout(location = 0) out vec4 sum_base_color;
layout(location = 1) out vec4 sum_offset;
layout(location = 2) out vec4 sum_normal;
layout(location = 3) out vec4 sum_emission;
layout(location = 4) out vec4 most;     // these two keep the greatest
layout(location = 5) out vec4 least;
#endif

void main()
{
#ifdef ALPHA_TEST
    if (material_emission.a * textureLod(base_color_texture, uv, 0.0).a < alpha_threshold)
        discard;
#endif
#ifdef OCCUPANCY
    out_there = 1.0;
#else
    vec3 base_color = material_base_color.rgb;
#ifdef TEXTURE
    // Texels as large as the surface that the point stands for.
    float texels = uv_scale * point_spacing * float(max(textureSize(base_color_texture, 0).x,
                                                        textureSize(base_color_texture, 0).y));
    base_color *= textureLod(base_color_texture, uv, log2(max(texels, 1.0))).rgb;
#endif
#ifdef ATTRIBUTE
    base_color *= color;
#endif
    base_color *= 1.0 - material_surface.x; // what is reflected diffusely
    vec3 front = vec3(0.0), back = vec3(0.0);
#ifdef EMISSION
    front = glow.x * finite_radiance(material_emission.rgb);
    back = glow.y * finite_radiance(material_emission.rgb);
#endif
    sum_base_color = vec4(clamp(base_color, 0.0, LARGEST_REFLECTANCE), 1.0) * area;
    sum_offset = vec4(offset, back.r) * area;
    sum_normal = vec4(normal, back.g) * area;
    sum_emission = vec4(front, back.b) * area;
    most = vec4(0.5 + min(high, 0.5), max(front.r, max(front.g, front.b)));
    least = vec4(0.5 - max(low, -0.5), max(back.r, max(back.g, back.b)));
#endif
}
