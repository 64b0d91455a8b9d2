// SPDX-License-Identifier: GPL-3.0-or-later

/** Luminance of linear Rec. 709 colour, in the colour's unit (ITU-R BT.709-6). */
float luminance(vec3 color)
{
    return dot(color, vec3(0.2126, 0.7152, 0.0722));
}
