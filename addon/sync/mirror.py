# SPDX-License-Identifier: GPL-3.0-or-later
"""The mirror of one Blender scene and view layer as plain data."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..scene import InstanceBatch, Light, Material, Scene
from ..scene.arrays import BoolArray
from .camera import camera_messages, render_camera
from .changes import Messages, with_versions
from .effects import effect_messages
from .instances import Placements, Traits, build_batch, read_matrices, shown_instances
from .keys import MeshKeys, batch_key, id_key, instance_id, instance_key
from .lights import read_light
from .linking import LightLinks
from .materials import MaterialTable, missing_attribute_messages
from .meshes import MeshRecord, update_mesh
from .visibility import Hidden, Placer, Visibility
from .world import WorldTable

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
_LIGHT_SEEN = "Lights are not shown to the camera yet; only what they light is seen of:"
_EMITTER_LINKED = "Light linking of emissive surfaces is not rendered yet; these light everything:"


@dataclass(frozen=True)
class SyncResult:
    """A frozen scene, what could not be mirrored (complete sentences), how long mirroring took, and what of the
    scene the viewport does not show for which it was mirrored (nothing without one)."""

    scene: Scene
    warnings: tuple[str, ...]
    seconds: float
    hidden: Hidden


class Mirror:
    """Mirrors one Blender scene and view layer; holds no Blender object between calls.

    Blender's data is compared with what was read before, so undo, animation and edits of any kind are the same to
    it, and what did not change stays the very same object with the same version.
    """

    def __init__(self) -> None:
        self._scene = Scene()
        self._meshes: dict[str, MeshRecord] = {}
        self._materials = MaterialTable()
        self._world = WorldTable()

    def sync(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D | None = None) -> SyncResult:
        """Compare with `depsgraph` and return the scene as it is now; the same `Scene` where nothing changed.

        The scene is that of all viewports together. What `space`, one of them, does not show of it is told apart,
        so that viewports in local view share their meshes with the others; `without_hidden` takes it away.
        """
        start = time.perf_counter()
        messages = Messages()
        self._materials.begin(_updated_images(depsgraph), messages)
        gathering = _Gathering(depsgraph, space, self._meshes, self._materials, messages)
        gathering.run()
        self._meshes = gathering.meshes
        batches, hidden = gathering.batches({batch.key: batch for batch in self._scene.batches})
        blender_scene: Any = depsgraph.scene_eval
        world, suns = self._world.read(depsgraph, self._materials.images, messages)
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
            lights=(*gathering.lights(), *suns),
            world=world,
            camera=render_camera(depsgraph, max(width, 1), max(height, 1)),
        )
        missing_attribute_messages(scene, messages)
        if space is None:
            effect_messages(depsgraph, messages)
        self._scene = with_versions(scene, self._scene)
        return SyncResult(self._scene, messages.texts(), time.perf_counter() - start, hidden)


class _Gathering:
    """One walk over the depsgraph's instances."""

    def __init__(
        self,
        depsgraph: bpy.types.Depsgraph,
        space: bpy.types.SpaceView3D | None,
        previous: dict[str, MeshRecord],
        materials: MaterialTable,
        messages: Messages,
    ) -> None:
        self.meshes: dict[str, MeshRecord] = {}
        self._lights: list[tuple[Light, Any]] = []
        self._hidden_lights: set[str] = set()
        self._depsgraph = depsgraph
        self._previous = previous
        self._materials = materials
        self._messages = messages
        view_layer: Any = depsgraph.view_layer_eval
        self._override = view_layer.material_override
        blender_scene: Any = depsgraph.scene_eval
        self._frames_per_second = blender_scene.render.fps / blender_scene.render.fps_base
        self._visibility = Visibility(depsgraph, space, messages)
        self._matrices = read_matrices(depsgraph)
        self._links = LightLinks(messages)
        self._drawn: dict[tuple[int, int, int], tuple[Placements, int] | None] = {}
        self._placements: dict[tuple[str, tuple[str, ...], Traits], Placements] = {}
        self._mesh_keys = MeshKeys()

    def run(self) -> None:
        """Fill `meshes`, the lights and the placements."""
        for row, instance, shown in shown_instances(self._depsgraph):
            kind = shown.type
            if kind == "MESH":
                self._place(row, instance, shown)
            elif kind == "LIGHT":
                self._add_light(row, instance, shown)
            elif kind in _UNSUPPORTED:
                self._messages.add_named(_UNSUPPORTED[kind], shown.name)

    def batches(self, previous: dict[str, InstanceBatch]) -> tuple[tuple[InstanceBatch, ...], Hidden]:
        """The placements as batches in the order of their keys, and what of them and the lights is hidden."""
        batches: list[InstanceBatch] = []
        hidden: dict[str, BoolArray] = {}
        for placements in sorted(self._placements.values(), key=lambda placements: placements.key):
            batch, rows = build_batch(placements, self._matrices, previous.get(placements.key), self._messages)
            if batch.count:
                batches.append(batch)
                if rows.any():
                    hidden[batch.key] = rows
        return tuple(batches), Hidden(hidden, frozenset(self._hidden_lights))

    def lights(self) -> tuple[Light, ...]:
        """The lights in the order of their keys, linked to the groups of all placements."""
        linked = (self._links.linked(light, emitter) for light, emitter in self._lights)
        return tuple(sorted(linked, key=lambda light: light.key))

    def _add_light(self, row: int, instance: Any, shown: Any) -> None:
        key = instance_key(instance)
        placer = instance.parent if instance.is_instance else shown
        light = read_light(key, shown, placer, self._matrices[row], self._materials.images, self._messages)
        if light is None:
            return
        self._lights.append((light, shown.original))
        if not self._visibility.shows(shown):
            self._hidden_lights.add(key)
        if self._depsgraph.mode == "RENDER" and shown.visible_camera and placer.visible_camera:
            self._messages.add_named(_LIGHT_SEEN, shown.name)

    def _place(self, row: int, instance: Any, shown: Any) -> None:
        placer = self._visibility.placer(instance, shown)
        identity = (shown.data.as_pointer(), shown.original.session_uid, placer.uid)
        if identity not in self._drawn:
            self._drawn[identity] = self._first(instance, shown, placer)
        entry = self._drawn[identity]
        if entry is not None:
            placements, object_index = entry
            placements.add(row, object_index, instance_id(instance, placer.uid), hidden=not placer.shown_in_viewport)

    def _first(self, instance: Any, shown: Any, placer: Placer) -> tuple[Placements, int] | None:
        """What all placements of one object with one mesh by one placer share; None where there is nothing to draw."""
        seen = shown.visible_camera and placer.seen_by_camera
        casts_shadow = shown.visible_shadow and placer.casts_shadow
        if not (seen or casts_shadow):
            return None
        if not instance.is_instance and _has_hair(shown):
            self._messages.add_named(_HAIR, shown.name)
        mesh = shown.to_mesh() if shown.data.is_editmode else shown.data  # whose own polygons wait for the mode's end
        if len(mesh.polygons) == 0:
            if not (instance.is_instance or _is_instancer(shown)):
                self._messages.add_named(_NO_FACES, shown.name)
            return None
        slots, attribute = self._slot_materials(shown)
        if any(material.is_emissive for material in slots) and _is_linked_emitter(shown.original):
            self._messages.add_named(_EMITTER_LINKED, shown.name)
        key, name = self._mesh_keys.key(shown)
        if key not in self.meshes:
            previous = self._previous.get(key)
            self.meshes[key] = update_mesh(key, shown.name, mesh, attribute, self._frames_per_second, previous)
            self._messages.extend(key, self.meshes[key].warnings)
        if not self.meshes[key].mesh.slots:
            return None
        placements = self._placements_of(key, name, slots, Traits(seen, casts_shadow, self._links.group(shown, placer)))
        placements.names.add(shown.name)
        return placements, shown.pass_index

    def _placements_of(self, mesh: str, name: str, slots: tuple[Material, ...], traits: Traits) -> Placements:
        """The placements of a mesh, by key and name, with the same materials and traits."""
        materials = tuple(material.key for material in slots)
        identity = (mesh, materials, traits)
        if identity not in self._placements:
            names = (name, *(material.name for material in slots))
            key = batch_key(names, mesh, materials, traits.differences)
            self._placements[identity] = Placements(key, mesh, materials, traits)
        return self._placements[identity]

    def _slot_materials(self, shown: Any) -> tuple[tuple[Material, ...], str | None]:
        """The materials in an object's slots, and the colour attribute that the first of them reads."""
        slots = [slot.material for slot in shown.material_slots] or [None]
        if self._override is not None:
            slots = [self._override]
        records = [self._materials.use(material) for material in slots]
        attribute = next((record.attribute for record in records if record.attribute is not None), None)
        return tuple(record.material for record in records), attribute


def _has_hair(shown: Any) -> bool:
    return any(
        system.settings.type == "HAIR" and system.settings.render_type == "PATH" for system in shown.particle_systems
    )


def _is_linked_emitter(original: Any) -> bool:
    linking = original.light_linking
    return linking.receiver_collection is not None or linking.blocker_collection is not None


def _is_instancer(shown: Any) -> bool:
    return shown.instance_type != "NONE" or any(m.type in {"NODES", "PARTICLE_SYSTEM"} for m in shown.modifiers)


def _updated_images(depsgraph: bpy.types.Depsgraph) -> frozenset[str]:
    updated: list[Any] = [update.id for update in depsgraph.updates]
    return frozenset(id_key("image", item) for item in updated if item.bl_rna.identifier == "Image")
