// SPDX-License-Identifier: GPL-3.0-or-later
// Unit vectors in two components (Cigolle et al. 2014, "A Survey of Efficient Representations for Independent Unit
// Vectors"): the octahedron |x| + |y| + |z| = 1 unfolded onto a square.

vec2 fold_octahedron(vec2 p)
{
    return (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
}

/** Unit vector -> [0, 1]². */
vec2 encode_octahedral(vec3 n)
{
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    return 0.5 * (n.z >= 0.0 ? p : fold_octahedron(p)) + 0.5;
}

/** [0, 1]² -> unit vector. */
vec3 decode_octahedral(vec2 encoded)
{
    vec2 p = 2.0 * encoded - 1.0;
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    if (n.z < 0.0)
        n.xy = fold_octahedron(n.xy);
    return normalize(n);
}
