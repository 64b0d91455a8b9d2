// SPDX-License-Identifier: GPL-3.0-or-later
// What the rasteriser interpolates: the members of the block that the stages of a geometry pass hand on.

#if defined(WRITE_NORMAL)
#define SURFACE_FACING vec3 position; vec3 normal; flat float handedness;
#elif defined(EXIT)
#define SURFACE_FACING flat float handedness;
#else
#define SURFACE_FACING
#endif

#ifdef TEXTURE
#define SURFACE_UV vec2 uv;
#else
#define SURFACE_UV
#endif

#ifdef ATTRIBUTE
#define SURFACE_COLOR vec3 color;
#else
#define SURFACE_COLOR
#endif

#ifdef WRITE_OBJECT_INDEX
#define SURFACE_OBJECT_INDEX flat uint object_index;
#else
#define SURFACE_OBJECT_INDEX
#endif

#ifdef WRITE_MATERIAL
#define SURFACE_LINK_GROUP flat int link_group;
#else
#define SURFACE_LINK_GROUP
#endif

// Clip x, y, w of now, and clip x, y, w and view depth of the previous frame.
#ifdef PREVIOUS
#define SURFACE_PREVIOUS vec3 clip; vec4 previous;
#else
#define SURFACE_PREVIOUS
#endif

#define SURFACE_MATERIAL SURFACE_UV SURFACE_COLOR SURFACE_OBJECT_INDEX SURFACE_LINK_GROUP
#define SURFACE float view_depth; flat int layer; SURFACE_FACING SURFACE_MATERIAL SURFACE_PREVIOUS
