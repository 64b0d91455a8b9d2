# SPDX-License-Identifier: GPL-3.0-or-later
"""Which lights a picture is lit by, and why the others are left out. Pure: no OpenGL, no Blender."""

from dataclasses import dataclass

import numpy as np

from ..scene import Camera, EmissionSampling, Light, RenderSettings, Scene
from .light_reach import MANY_LIGHTS, extent, farthest_reach, full_reach, lights_out_of_reach, peak_intensity
from .memory import Memory
from .mesh_lights import GREATEST_COUNT, MeshLight, mesh_lights

_NOT_WORTH_IT = (
    f"too faint to be sampled as a light, or not among the {GREATEST_COUNT} strongest; left to indirect light"
)


@dataclass(frozen=True)
class LightPlan:
    """The lights of a picture.

    `lights`, `mesh_lights`: sampled every sample. `reach` (m) of each of `lights`: beyond it one is only sampled now
    and then. `world_directions`: from how many directions the world lights each sample. `preview`: whether the first
    sample shows lights by closed forms and their shadows from their centres. `casts_shadows`: whether anything does.
    `world_gathered`: whether the world's diffuse light is left to the indirect method.
    """

    lights: tuple[Light, ...] = ()
    mesh_lights: tuple[MeshLight, ...] = ()
    reach: tuple[float, ...] = ()
    world_directions: int = 0
    preview: bool = False
    casts_shadows: bool = False
    world_gathered: bool = False

    @property
    def count(self) -> int:
        """Lights of a sample, directions of the world included."""
        return len(self.lights) + len(self.mesh_lights) + self.world_directions

    @property
    def many(self) -> bool:
        """Whether pixels ask only the lights that reach them."""
        return len(self.lights) > MANY_LIGHTS


def plan_lights(
    scene: Scene,
    settings: RenderSettings,
    camera: Camera | None,
    memory: Memory,
    *,
    continuous: bool,
    world_gathered: bool = False,
) -> tuple[LightPlan, list[tuple[str, str]]]:
    """The lights of a picture, and (name, reason) of what is left out.

    `world_gathered`: only what reflects otherwise than diffusely needs the world's light.
    `memory` of earlier pictures afterwards holds what this one is made of.
    """
    left_out: list[tuple[str, str]] = []
    lights = _lights_in_reach(scene, settings, camera, memory, left_out)
    surfaces, dim = mesh_lights(scene, settings.alpha_threshold, memory)
    left_out += [(f"light of {light.name}", _NOT_WORTH_IT) for light in dim]
    left_out += _unsampled_emission(scene)
    casts = any(light.casts_shadow for light in lights) or bool(surfaces) or _samples_world(scene, world_gathered)
    casters = any(batch.casts_shadow for batch in scene.batches)
    intensities = np.array([peak_intensity(light) for light in lights])
    extents = np.array([extent(light) for light in lights])
    reach = full_reach(intensities, extents, settings.light_threshold)
    planned = LightPlan(
        lights,
        surfaces,
        tuple(float(distance) for distance in reach),
        settings.world_directions if _samples_world(scene, world_gathered) else 0,
        preview=continuous or settings.samples == 1,
        casts_shadows=casts and casters,
        world_gathered=world_gathered,
    )
    return planned, left_out


def _samples_world(scene: Scene, gathered: bool) -> bool:
    if not gathered:
        return scene.world.shines
    return scene.world.shines and scene.world.seen_by_glossy and any(m.is_glossy for m in scene.materials.values())


def _unsampled_emission(scene: Scene) -> list[tuple[str, str]]:
    """(name, reason) of emissive surfaces that are not even looked at as lights."""
    emissive = [material for material in scene.materials.values() if material.is_emissive]
    unsampled = [material for material in emissive if material.emission_sampling is EmissionSampling.NONE]
    pierced = [material for material in emissive if material.is_alpha_tested and material not in unsampled]
    found = [(f"light of {item.name}", "its Emission Sampling is None; left to indirect light") for item in unsampled]
    found += [(f"light of {item.name}", "an image cuts it out; left to indirect light") for item in pierced]
    glowing = {item.key for item in emissive if item.emission_sampling is EmissionSampling.AUTO} - {
        item.key for item in pierced
    }
    for batch in scene.batches:
        if batch.count > GREATEST_COUNT + 1 and glowing.intersection(batch.materials):
            more = batch.count - GREATEST_COUNT - 1
            found.append((f"light of {more} more instances of {scene.meshes[batch.mesh].name}", _NOT_WORTH_IT))
    return found


def _lights_in_reach(
    scene: Scene, settings: RenderSettings, camera: Camera | None, memory: Memory, left_out: list[tuple[str, str]]
) -> tuple[Light, ...]:
    """Those that may reach what the camera sees."""
    if camera is None or not scene.lights:
        return scene.lights
    intensities = np.array([peak_intensity(light) for light in scene.lights])
    extents = np.array([extent(light) for light in scene.lights])
    full = full_reach(intensities, extents, settings.light_threshold)
    keys = [light.key for light in scene.lights]
    farthest = farthest_reach(full, keys, settings.samples, settings.seed)
    lost = dict(lights_out_of_reach(scene.lights, farthest, scene, camera, memory))
    left_out += [(f"light “{scene.lights[index].name}”", reason) for index, reason in lost.items()]
    return tuple(light for index, light in enumerate(scene.lights) if index not in lost)
