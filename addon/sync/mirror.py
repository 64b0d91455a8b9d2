# SPDX-License-Identifier: GPL-3.0-or-later
"""The mirror of one Blender scene and view layer as plain data."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ..scene import InstanceBatch, Light, Scene
from .camera import camera_messages, render_camera
from .changes import Messages, new_version, same_fields
from .instances import Placements, build_batch, read_matrices, shown_instances
from .keys import MeshKeys, id_key, instance_key
from .lights import read_light
from .materials import MaterialTable
from .meshes import MeshRecord, update_mesh
from .world import read_world

if TYPE_CHECKING:
    import bpy


_UNSUPPORTED = {
    "CURVES": "Hair curves are not rendered yet; left out:",
    "POINTCLOUD": "Point clouds are not rendered yet; left out:",
    "VOLUME": "Volumes are not rendered yet; left out:",
    "GREASEPENCIL": "Grease pencil is not rendered yet; left out:",
}
_HAIR = "Particle hair is not rendered yet; left out on:"
_NO_FACES = "These have no faces and are not seen:"


@dataclass(frozen=True)
class SyncResult:
    """A frozen scene, what could not be mirrored (complete sentences), and how long mirroring took."""

    scene: Scene
    warnings: tuple[str, ...]
    seconds: float


class Mirror:
    """Mirrors one Blender scene and view layer; holds no Blender object between calls.

    Blender's data is compared with what was read before, so undo, animation and edits of any kind are the same to
    it, and what did not change stays the very same object with the same version.
    """

    def __init__(self) -> None:
        self._scene = Scene()
        self._meshes: dict[str, MeshRecord] = {}
        self._materials = MaterialTable()

    def sync(self, depsgraph: bpy.types.Depsgraph) -> SyncResult:
        """Compare with `depsgraph` and return the scene as it is now; the same `Scene` where nothing changed."""
        start = time.perf_counter()
        messages = Messages()
        self._materials.begin(_updated_images(depsgraph), messages)
        gathering = _Gathering(depsgraph, self._meshes, self._materials, messages)
        gathering.run()
        self._meshes = gathering.meshes
        batches = gathering.batches({batch.key: batch for batch in self._scene.batches})
        blender_scene: Any = depsgraph.scene_eval
        world = read_world(blender_scene.world, self._materials.images, messages)
        materials, images = self._materials.collect()
        camera_messages(depsgraph, messages)
        render = blender_scene.render
        scale = render.resolution_percentage / 100.0
        width, height = int(render.resolution_x * scale), int(render.resolution_y * scale)
        scene = Scene(
            meshes={record.mesh.key: record.mesh for record in self._meshes.values()},
            materials=materials,
            images=images,
            batches=batches,
            lights=tuple(sorted(gathering.lights, key=lambda light: light.key)),
            world=world,
            camera=render_camera(depsgraph, max(width, 1), max(height, 1)),
        )
        self._scene = _with_versions(scene, self._scene)
        return SyncResult(self._scene, messages.texts(), time.perf_counter() - start)


class _Gathering:
    """One walk over the depsgraph's instances."""

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        previous: dict[str, MeshRecord],
        materials: MaterialTable,
        messages: Messages,
    ) -> None:
        self.meshes: dict[str, MeshRecord] = {}
        self.lights: list[Light] = []
        self._depsgraph = depsgraph
        self._previous = previous
        self._materials = materials
        self._messages = messages
        view_layer: Any = depsgraph.view_layer_eval
        self._override = view_layer.material_override
        self._matrices = read_matrices(depsgraph)
        self._seen: dict[tuple[int, int], tuple[Placements, int] | None] = {}
        self._placements: dict[tuple[str, tuple[str, ...]], Placements] = {}
        self._mesh_keys = MeshKeys()

    def run(self) -> None:
        """Fill `meshes`, `lights` and the placements."""
        for row, instance, shown in shown_instances(self._depsgraph):
            kind = shown.type
            if kind == "MESH":
                self._place(row, instance, shown)
            elif kind == "LIGHT":
                key = instance_key(instance)
                light = read_light(key, shown, self._matrices[row], self._materials.images, self._messages)
                if light is not None:
                    self.lights.append(light)
            elif kind in _UNSUPPORTED:
                self._messages.add_named(_UNSUPPORTED[kind], shown.name)

    def batches(self, previous: dict[str, InstanceBatch]) -> tuple[InstanceBatch, ...]:
        """The placements as batches in the order of their keys."""
        ordered = sorted(self._placements.values(), key=lambda placements: placements.key)
        built = (build_batch(p, self._matrices, previous.get(p.key), self._messages) for p in ordered)
        return tuple(batch for batch in built if batch is not None)

    def _place(self, row: int, instance: Any, shown: Any) -> None:
        uid = shown.original.session_uid
        identity = (shown.data.as_pointer(), uid)
        if identity not in self._seen:
            self._seen[identity] = self._first(instance, shown)
        entry = self._seen[identity]
        if entry is not None:
            placements, object_index = entry
            placements.rows.append(row)
            placements.object_index.append(object_index)

    def _first(self, instance: Any, shown: Any) -> tuple[Placements, int] | None:
        """What all instances of one object with one mesh share; None where there is nothing to draw."""
        if not instance.is_instance and _has_hair(shown):
            self._messages.add_named(_HAIR, shown.name)
        mesh = shown.data
        if len(mesh.polygons) == 0:
            if not (instance.is_instance or _is_instancer(shown)):
                self._messages.add_named(_NO_FACES, shown.name)
            return None
        materials, attribute = self._slot_materials(shown)
        key = self._mesh_keys.key(shown)
        if key not in self.meshes:
            self.meshes[key] = update_mesh(key, shown.name, mesh, attribute, self._previous.get(key))
            self._messages.extend(key, self.meshes[key].warnings)
        if not self.meshes[key].mesh.slots:
            return None
        if (key, materials) not in self._placements:
            self._placements[key, materials] = Placements(key, materials)
        placements = self._placements[key, materials]
        placements.names.add(shown.name)
        return placements, shown.pass_index

    def _slot_materials(self, shown: Any) -> tuple[tuple[str, ...], str | None]:
        """Keys of the materials in an object's slots, and the colour attribute that the first of them reads."""
        slots = [slot.material for slot in shown.material_slots] or [None]
        if self._override is not None:
            slots = [self._override]
        records = [self._materials.use(material) for material in slots]
        attribute = next((record.attribute for record in records if record.attribute is not None), None)
        return tuple(record.material.key for record in records), attribute


def _has_hair(shown: Any) -> bool:
    return any(
        system.settings.type == "HAIR" and system.settings.render_type == "PATH" for system in shown.particle_systems
    )


def _is_instancer(shown: Any) -> bool:
    return shown.instance_type != "NONE" or any(m.type in {"NODES", "PARTICLE_SYSTEM"} for m in shown.modifiers)


def _updated_images(depsgraph: bpy.types.Depsgraph) -> frozenset[str]:
    updated: list[Any] = [update.id for update in depsgraph.updates]
    return frozenset(id_key("image", item) for item in updated if item.bl_rna.identifier == "Image")


def _with_versions(scene: Scene, previous: Scene) -> Scene:
    """`scene` with versions raised where it differs from `previous`, or `previous` itself."""
    changed = {
        "geometry": not _same_items(scene.meshes, previous.meshes),
        "transforms": not _same_batches(scene.batches, previous.batches),
        "materials": not (
            _same_items(scene.materials, previous.materials) and _same_items(scene.images, previous.images)
        ),
        "lights": not _same_lights(scene.lights, previous.lights),
        "camera": not same_fields(scene.camera, previous.camera),
        "world": scene.world != previous.world,
    }
    raised = {name: new_version() for name, differs in changed.items() if differs}
    if not raised:
        return previous
    return replace(scene, versions=replace(previous.versions, **raised))


def _same_items(first: Mapping[str, object], second: Mapping[str, object]) -> bool:
    return first.keys() == second.keys() and all(first[key] is second[key] for key in first)


def _same_batches(first: tuple[InstanceBatch, ...], second: tuple[InstanceBatch, ...]) -> bool:
    return len(first) == len(second) and all(a is b for a, b in zip(first, second, strict=True))


def _same_lights(first: tuple[Light, ...], second: tuple[Light, ...]) -> bool:
    return len(first) == len(second) and all(same_fields(a, b) for a, b in zip(first, second, strict=True))
