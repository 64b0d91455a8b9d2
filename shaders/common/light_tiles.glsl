// SPDX-License-Identifier: GPL-3.0-or-later
// Which of many lights may reach a pixel's tile, as shaders/light_tiles wrote it. To visit them:
//
//     for (int page = 0; page < light_tile_pages; ++page) {
//         uvec4 words = light_tile_page(pixel, layer, light_tile_pages, page);
//         for (int word = 0; word < 4; ++word)
//             for (uint left = words[word]; left != 0u; left &= left - 1u)
//                 visit(light_tile_index(page, word, left));
//     }

uniform usampler2DArray tile_lights;

/** LIGHTS_PER_PAGE bits, set where a light may reach the tile of a pixel (of the guarded picture) in a layer. */
uvec4 light_tile_page(ivec2 pixel, int layer, int pages, int page)
{
    return texelFetch(tile_lights, ivec3(pixel / TILE_SIZE, layer * pages + page), 0);
}

/** Index of the light that the lowest bit of what is left of a page's word 0…3 stands for. */
int light_tile_index(int page, int word, uint left)
{
    return LIGHTS_PER_PAGE * page + 32 * word + findLSB(left);
}
