# SPDX-License-Identifier: GPL-3.0-or-later
"""How one pass over the geometry reaches several layers, and which way is faster on a device."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from ..scene import Camera, InstanceBatch, Layering, Material, Mesh, RenderSettings, Scene, SlotRange, Variant
from ..scene.versions import new_version
from .device import Device, RenderError
from .programs import ShaderError

_GRID = 80
_SAMPLES = 4


@dataclass(frozen=True)
class Trial:
    """What a way of layering gave in the calibration view: milliseconds of the geometry pass, and its layers' bits."""

    milliseconds: float
    bits: bytes


def resolved(settings: RenderSettings, device: Device, attempt: Callable[[RenderSettings], Trial]) -> Layering:
    """The way to take: what is asked for, or what is best on the device, found once per process by rendering.

    Raises RenderError where the driver does not have what is asked for.
    """
    if settings.layering is Layering.VERTEX_SHADER and device.vertex_layer_extension is None:
        raise RenderError("The graphics driver cannot write gl_Layer in a vertex shader; use a geometry shader.")
    if settings.layering is not Layering.FASTEST:
        return settings.layering
    if device.fastest_layering is None:
        device.fastest_layering = _fastest(device, attempt)
    return device.fastest_layering


def _fastest(device: Device, attempt: Callable[[RenderSettings], Trial]) -> Layering:
    """The faster of those that round as separate passes do: which one it was must not be seen in a picture.

    (llvmpipe's geometry shaders interpolate differently in the last place.)
    """
    if device.vertex_layer_extension is None:
        return Layering.GEOMETRY_SHADER
    separate = attempt(calibration_settings(Variant.TWO_PASS, Layering.VERTEX_SHADER)).bits
    ways = (Layering.VERTEX_SHADER, Layering.GEOMETRY_SHADER)
    trials = {way: _attempted(attempt, calibration_settings(Variant.PREPASS, way)) for way in ways}
    equal = [way for way in ways if trials[way].bits == separate]
    return min(equal or ways, key=lambda way: trials[way].milliseconds)


def _attempted(attempt: Callable[[RenderSettings], Trial], settings: RenderSettings) -> Trial:
    """The trial; one that anything else is better than where the driver's compiler refuses."""
    try:
        return attempt(settings)
    except ShaderError:
        return Trial(inf, b"")


def calibration_settings(variant: Variant, layering: Layering) -> RenderSettings:
    """Settings of the calibration view; the first of its samples compiles the programs."""
    return RenderSettings(250, 190, samples=_SAMPLES, deep_output=True, variant=variant, layering=layering)


def calibration_view() -> tuple[Scene, Camera]:
    """What ways of layering are tried on: two tilted grids of 12,000 small triangles, one behind the other.

    Nothing about it is a round number, so that ways that round differently show it.
    """
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, _GRID), np.linspace(-1.0, 1.0, _GRID))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1).astype(np.float32)
    corner = (np.arange(_GRID - 1)[:, None] * _GRID + np.arange(_GRID - 1)).reshape(-1, 1)
    quads = corner + np.array([0, 1, _GRID + 1, _GRID])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.uint32)
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(positions), 1))
    slots = (SlotRange(0, 0, len(triangles)),)
    mesh = Mesh("grid", "calibration grid", new_version(), positions, normals, triangles, slots)
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[:, 2, :2] = 0.3, -0.2
    matrices[1, 2, 3] = -1.0
    ids = np.arange(2)
    batch = InstanceBatch("grids", "grid", ("grey",), new_version(), matrices, ids.astype(np.int32), ids)
    scene = Scene({"grid": mesh}, {"grey": Material("grey", "grey", new_version())}, batches=(batch,))
    pose = np.eye(4)
    pose[2, 3] = 2.0
    return scene, Camera(pose, (-0.51, 0.47, -0.37, 0.39), 0.1, 10.0)
