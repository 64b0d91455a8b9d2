// SPDX-License-Identifier: GPL-3.0-or-later

/** Two unit vectors perpendicular to n (Duff et al. 2017, "Building an Orthonormal Basis, Revisited"). */
void orthonormal_basis(vec3 n, out vec3 tangent, out vec3 bitangent)
{
    float s = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    bitangent = vec3(b, s + n.y * n.y * a, -n.y);
}
