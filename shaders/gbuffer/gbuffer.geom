// SPDX-License-Identifier: GPL-3.0-or-later
// Copies each triangle into GEOMETRY_LAYERS layers, so that its vertices are transformed only once. GEOMETRY_VERTICES
// is three times as many: GLSL 4.10 takes no expression there.

#include "gbuffer/surface.glsl"
#include "generated/GBufferUniforms.glsl"

layout(triangles) in;
layout(triangle_strip, max_vertices = GEOMETRY_VERTICES) out;

invariant gl_Position;

in Surface
{
    SURFACE
} corners[];
#ifdef LOOK_AHEAD
in Ahead
{
    vec4 position;
    float view_depth;
} ahead[];
#endif
out Surface
{
    SURFACE
} surface;

/** Hand on one corner of the triangle, all but its place and its layer. */
void copy_corner(int corner)
{
#if defined(WRITE_NORMAL) || defined(EXIT)
    surface.handedness = corners[corner].handedness;
#endif
#ifdef WRITE_NORMAL
    surface.position = corners[corner].position;
    surface.normal = corners[corner].normal;
#endif
#ifdef TEXTURE
    surface.uv = corners[corner].uv;
#endif
#ifdef ATTRIBUTE
    surface.color = corners[corner].color;
#endif
#ifdef WRITE_OBJECT_INDEX
    surface.object_index = corners[corner].object_index;
#endif
#ifdef WRITE_MATERIAL
    surface.link_group = corners[corner].link_group;
#endif
#ifdef PREVIOUS
    surface.clip = corners[corner].clip;
    surface.previous = corners[corner].previous;
#endif
}

void main()
{
    for (int layer = 0; layer < GEOMETRY_LAYERS; ++layer)
    {
        for (int corner = 0; corner < 3; ++corner)
        {
            copy_corner(corner);
            surface.view_depth = corners[corner].view_depth;
            gl_Position = gl_in[corner].gl_Position;
#ifdef LOOK_AHEAD
            if (layer == look_ahead_layer)
            {
                surface.view_depth = ahead[corner].view_depth;
                gl_Position = ahead[corner].position;
            }
#endif
            gl_ClipDistance[0] = clip_end - surface.view_depth;
            surface.layer = first_layer + layer;
            gl_Layer = layer;
            EmitVertex();
        }
        EndPrimitive();
    }
}
