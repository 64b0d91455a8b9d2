// SPDX-License-Identifier: GPL-3.0-or-later

const float PI = 3.14159265358979;
const float FLOAT_EPSILON = 1.1920929e-7; // relative spacing of float32
