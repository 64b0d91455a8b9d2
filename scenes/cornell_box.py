# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cornell box after the measured data of the Cornell Program of Computer Graphics, in metres (1 m for 100 mm).

https://www.graphics.cornell.edu/online/box/data.html; Blender's z is the data's y. Surfaces are diffuse, their colours
the spectra's usual linear RGB. The lamp is an area light in the ceiling's opening, so it lights and is not seen.
"""

from _builder import area_light, camera, material, mesh_object, new_scene, save

CORNER_FACES = [(0, 1, 2, 3)]
BLOCK_FACES = [(0, 1, 2, 3), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
LIGHT_SIZE = (1.3, 1.05)


def metres(*points: tuple[float, float, float]) -> list[tuple[float, float, float]]:
    """The data's millimetres (x to the left, y up, z away) as Blender's metres (x right, y away, z up)."""
    return [(2.78 - x / 100.0, z / 100.0, y / 100.0) for x, y, z in points]


def block(height: float, footprint: list[tuple[float, float]]) -> list[tuple[float, float, float]]:
    """Eight corners of a block: the top, then the bottom."""
    return metres(*((x, height, z) for x, z in footprint), *((x, 0.0, z) for x, z in footprint))


def main() -> None:
    """Build and save the scene."""
    scene = new_scene((0.0, 0.0, 0.0))
    scene.view_settings.view_transform = "Standard"
    white, red, green = (
        material(name, color, roughness=1.0, specular=0.0)
        for name, color in (
            ("White", (0.725, 0.71, 0.68)),
            ("Red", (0.63, 0.065, 0.05)),
            ("Green", (0.14, 0.45, 0.091)),
        )
    )
    mesh_object("Floor", metres((552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2)), CORNER_FACES, [white])
    mesh_object(
        "Back wall",
        metres((549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2)),
        CORNER_FACES,
        [white],
    )
    mesh_object("Right wall", metres((0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2)), CORNER_FACES, [green])
    mesh_object(
        "Left wall",
        metres((552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0)),
        CORNER_FACES,
        [red],
    )
    mesh_object(
        "Ceiling",
        metres((556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0)),
        CORNER_FACES,
        [white],
    )
    mesh_object("Short block", block(165, [(130, 65), (82, 225), (240, 272), (290, 114)]), BLOCK_FACES, [white])
    mesh_object("Tall block", block(330, [(423, 247), (265, 296), (314, 456), (472, 406)]), BLOCK_FACES, [white])
    area_light("Lamp", (0.0, 2.795, 5.485), (0.0, 0.0, -1.0), LIGHT_SIZE, 320.0, (1.0, 0.80, 0.56))
    # The data's camera: 35 mm in front of a film 25 mm high, which our wider picture keeps.
    camera((0.0, -8.0, 2.73), (0.0, 2.8, 2.73), lens=35.0 * 36.0 / (25.0 * 640.0 / 360.0))
    save(__file__)


if __name__ == "__main__":
    main()
