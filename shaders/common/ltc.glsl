// SPDX-License-Identifier: GPL-3.0-or-later
// Cosine lobes, plain and linearly transformed, integrated over what a polygon covers of the directions around a point.
// Lambert's formula for polygons, and Heitz, Dupuy, Hill and Neubelt 2016, "Real-Time Polygonal-Light Shading with
// Linearly Transformed Cosines".

#include "common/constants.glsl"

const int RECTANGLE_SIDES = 4;
// Of the polygon that stands for an ellipse of the same area: irradiance is then right to 2e-4, see the tests.
const int ELLIPSE_SIDES = 16;

// Of a lobe, that a polygon must cover to have a mean direction in float32.
const float SMALLEST_SHARE = 1e-15;

/** centre + x cosφ + y sinφ for the polygon's corners, from the shaded point; φ in equal steps. Any unit of length. */
struct Polygon
{
    vec3 center;
    vec3 x;
    vec3 y;
    int sides;
};

Polygon rectangle_polygon(vec3 center, vec3 half_x, vec3 half_y)
{
    return Polygon(center, sqrt(2.0) * half_x, sqrt(2.0) * half_y, RECTANGLE_SIDES);
}

/** Inscribed in a slightly larger ellipse, so that its area is that of the ellipse with these half axes. */
Polygon ellipse_polygon(vec3 center, vec3 half_x, vec3 half_y)
{
    const float STEP = 2.0 * PI / float(ELLIPSE_SIDES);
    float scale = sqrt(STEP / sin(STEP));
    return Polygon(center, scale * half_x, scale * half_y, ELLIPSE_SIDES);
}

Polygon transformed(mat3 matrix, Polygon polygon)
{
    return Polygon(matrix * polygon.center, matrix * polygon.x, matrix * polygon.y, polygon.sides);
}

/** Sum over the edges of what is left of a polygon above a horizon, and where its outline leaves and enters that. */
struct Outline
{
    vec3 sum;
    vec3 leaves;
    vec3 enters;
};

/** Angle between two corners along the normal of their plane; `edge` is b - a, in more digits than the difference. */
vec3 edge_vector(vec3 a, vec3 b, vec3 edge)
{
    vec3 normal = cross(a, edge);
    float sine = length(normal);
    return sine > 0.0 ? normal * (atan(sine, dot(a, b)) / sine) : vec3(0.0);
}

/** Cut an edge off where the heights of its ends are not above 0, and keep where; false if nothing is left of it. */
bool clip_edge(inout vec3 a, inout vec3 b, inout vec3 edge, float height_a, float height_b, inout Outline outline)
{
    if (height_a <= 0.0 && height_b <= 0.0)
        return false;
    if (height_a <= 0.0) {
        float kept = height_b / (height_b - height_a);
        edge *= kept;
        outline.enters = a = b - edge;
    } else if (height_b <= 0.0) {
        float kept = height_a / (height_a - height_b);
        edge *= kept;
        outline.leaves = b = a + edge;
    }
    return true;
}

void add_edge(inout Outline outline, vec3 a, vec3 b, vec3 edge)
{
    if (clip_edge(a, b, edge, a.z, b.z, outline))
        outline.sum += edge_vector(a, b, edge);
}

/** The sum with the edge along the horizon that closes a clipped outline. */
vec3 closed_sum(Outline outline)
{
    return outline.sum + edge_vector(outline.leaves, outline.enters, outline.enters - outline.leaves);
}

/**
 * Vector irradiance over π of the polygon as a light of radiance 1: its z is the share of a cosine lobe about z that
 * the polygon covers, and its direction the mean direction. `horizon`: normal of a plane below which nothing counts;
 * below z = 0 nothing does either.
 */
vec3 cosine_lobe_over(Polygon polygon, vec3 horizon)
{
    float scale = 1.0 / (length(polygon.center) + length(polygon.x) + length(polygon.y));
    vec3 center = scale * polygon.center, x = scale * polygon.x, y = scale * polygon.y;
    float turn = 2.0 * PI / float(polygon.sides);
    vec2 rotation = vec2(cos(turn), sin(turn));
    vec2 place = vec2(cos(0.5 * turn), sin(0.5 * turn));
    vec2 first_place = place;
    vec3 a = center + place.x * x + place.y * y;
    vec3 first = a;
    Outline above = Outline(vec3(0.0), vec3(0.0), vec3(0.0));
    Outline lobe = above;
    for (int side = 1; side <= polygon.sides; ++side) {
        vec2 next = vec2(place.x * rotation.x - place.y * rotation.y, place.x * rotation.y + place.y * rotation.x);
        next = side == polygon.sides ? first_place : next;
        vec3 b = side == polygon.sides ? first : center + next.x * x + next.y * y;
        vec3 from = a, to = b, edge = (next.x - place.x) * x + (next.y - place.y) * y;
        if (clip_edge(from, to, edge, dot(horizon, a), dot(horizon, b), above))
            add_edge(lobe, from, to, edge);
        a = b;
        place = next;
    }
    add_edge(lobe, above.leaves, above.enters, above.enters - above.leaves);
    vec3 sum = closed_sum(lobe) / (2.0 * PI);
    return sum.z < 0.0 ? -sum : sum;
}

#ifdef SPECULAR
uniform sampler2D ltc_table;

/** M⁻¹, from the frame with x along the view and z the normal; render/ltc.py holds the table. */
mat3 lookup_ltc(float roughness, float n_dot_v)
{
    vec2 size = vec2(textureSize(ltc_table, 0));
    vec2 place = vec2(roughness, sqrt(1.0 - n_dot_v)) * (size - 1.0);
    vec4 entry = textureLod(ltc_table, (place + 0.5) / size, 0.0);
    return mat3(entry.x, 0.0, entry.z, 0.0, 1.0, 0.0, entry.y, 0.0, entry.w);
}

/** What of the normalised lobe of GGX times n·l a polygon covers, in the frame of `lookup_ltc`. */
struct CoveredLobe
{
    float share;
    vec3 mean;              // unit, mean direction of that part
    float density;          // of the lobe in that direction, 1/sr
};

CoveredLobe specular_lobe_over(Polygon polygon, float roughness, float n_dot_v)
{
    mat3 inverse_matrix = lookup_ltc(roughness, n_dot_v);
    float a = inverse_matrix[0].x, b = inverse_matrix[2].x, c = inverse_matrix[0].z, d = inverse_matrix[2].z;
    // What of the polygon is above z = 0 here is above this plane there: the last row of M, to a positive factor.
    vec3 covered = cosine_lobe_over(transformed(inverse_matrix, polygon), vec3(-c, 0.0, a));
    float determinant = a * d - b * c;
    vec3 mean = vec3(d * covered.x - b * covered.z, determinant * covered.y, a * covered.z - c * covered.x);
    if (!(covered.z > SMALLEST_SHARE && mean.z > 0.0))
        return CoveredLobe(0.0, vec3(0.0, 0.0, 1.0), 1.0);
    mean = normalize(mean);
    vec3 original = inverse_matrix * mean;
    float squared = dot(original, original);
    return CoveredLobe(min(covered.z, 1.0), mean, original.z * determinant / (PI * squared * squared));
}
#endif
