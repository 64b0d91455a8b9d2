# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's materials as constants of the Principled BSDF, one base-colour texture, and warnings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import bpy

from ...scene import (
    BaseColorSource,
    EmissionSampling,
    Extension,
    Image,
    ImageTexture,
    Interpolation,
    Material,
    RenderSettings,
)
from ...scene.arrays import Color
from ..changes import Messages, new_version
from ..keys import DEFAULT_MATERIAL, id_key
from .expressions import Evaluator, Expression
from .graph import Node, find_output, find_source, has_nodes
from .images import ImageTable
from .missing import missing_attribute_messages
from .nodes import NODE_READERS
from .operations import as_value, unit
from .surfaces import BLACK, Surface, evaluate_surface

__all__ = ["ImageTable", "MaterialTable", "evaluate_emission", "has_nodes", "missing_attribute_messages"]


@dataclass(frozen=True)
class MaterialRecord:
    """A mirrored material; `attribute` names the colour attribute it reads, None for none or the mesh's own."""

    material: Material
    attribute: str | None
    warnings: tuple[str, ...]


class MaterialTable:
    """The materials in use, kept between syncs so that unchanged ones stay the same objects."""

    def __init__(self) -> None:
        self.images = ImageTable()
        self._previous: dict[str, MaterialRecord] = {}
        self._current: dict[str, MaterialRecord] = {}
        self._messages = Messages()

    def begin(self, updated: frozenset[str], messages: Messages) -> None:
        """Start a sync; `updated` are keys of images that Blender says were updated."""
        self._previous = self._current
        self._current = {}
        self._messages = messages
        self.images.begin(updated, messages)

    def use(self, material: bpy.types.Material | None) -> MaterialRecord:
        """The record of a slot's material; Blender's default grey for an empty slot."""
        key = DEFAULT_MATERIAL if material is None else id_key("material", material)
        record = self._current.get(key)
        if record is None:
            record = _default() if material is None else self._read(key, material)
            record = self._unless_equal(record)
            self._current[key] = record
            self._messages.extend(key, record.warnings)
        return record

    def collect(self) -> tuple[dict[str, Material], dict[str, Image]]:
        """Materials used since `begin`, and their images, by key."""
        materials = {key: record.material for key, record in sorted(self._current.items())}
        textures = {material.texture.image for material in materials.values() if material.texture is not None}
        return materials, self.images.collect(textures)

    def _unless_equal(self, record: MaterialRecord) -> MaterialRecord:
        previous = self._previous.get(record.material.key)
        if previous is None:
            return record
        same = replace(record.material, version=previous.material.version) == previous.material
        return replace(record, material=previous.material) if same else record

    def _read(self, key: str, material: bpy.types.Material) -> MaterialRecord:
        owner = f"Material “{material.name}”"
        tree: Any = material.node_tree
        if not has_nodes(material):
            return _without_nodes(key, material)
        evaluator = Evaluator(owner, self.images, NODE_READERS)
        output = find_output(tree, "ShaderNodeOutputMaterial")
        if output is None or find_source(output.inputs["Surface"], ()).node is None:
            text = f"{owner} has no surface shader connected to its output; it is shown black."
            return MaterialRecord(_material(key, material, Surface()), None, (text,))
        surface = evaluate_surface(output.inputs["Surface"], (), evaluator)
        _warn_blended(surface, find_source(output.inputs["Surface"], ()).node, evaluator)
        for name in ("Volume", "Displacement"):
            if find_source(output.inputs[name], ()).node is not None:
                evaluator.warn(output, f"{name.lower()} is not rendered yet")
        return self._with_texture(_material(key, material, surface), surface, evaluator)

    def _with_texture(self, material: Material, surface: Surface, evaluator: Evaluator) -> MaterialRecord:
        """`material` with what its base colour and alpha read."""
        base, alpha = surface.base_color, surface.alpha
        if base.texture is None and alpha.texture is None:
            source = BaseColorSource.CONSTANT if base.attribute is None else BaseColorSource.ATTRIBUTE
            return MaterialRecord(replace(material, source=source), base.attribute or None, tuple(evaluator.warnings))
        if base.attribute is not None and alpha.texture is not None:
            evaluator.warn(
                alpha.texture,
                "alpha from an image is not rendered together with a colour attribute yet; the attribute is left out",
            )
        return self._textured(material, base, alpha, evaluator)

    def _textured(
        self, material: Material, base: Expression, alpha: Expression, evaluator: Evaluator
    ) -> MaterialRecord:
        owner = evaluator.owner
        color = None if base.texture is None else self.images.mirror(base.texture, owner).image
        if color is not None and base.component != "RGB":
            color = self.images.as_grey(color, base.component)
        image = color
        if alpha.texture is not None:
            mask = self.images.mirror(alpha.texture, owner).image
            if color is None or mask.key != color.key or alpha.component != "ALPHA":
                image = self.images.with_mask(color, mask, alpha.component)
        assert image is not None
        node: Any = alpha.texture if base.texture is None else base.texture
        texture = ImageTexture(
            image=image.key,
            extension=Extension(node.extension),
            interpolation=Interpolation.CLOSEST if node.interpolation == "Closest" else Interpolation.LINEAR,
        )
        textured = replace(
            material, source=BaseColorSource.TEXTURE, texture=texture, texture_alpha=alpha.texture is not None
        )
        return MaterialRecord(textured, None, tuple(evaluator.warnings))


def evaluate_emission(owner: str, tree: Any, output_type: str, images: ImageTable) -> tuple[Color, tuple[str, ...]]:
    """The constant emission of a world's or light's node graph, and texts about what is not constant in it.

    `owner` begins each text; `output_type` is the graph's kind of output node. Black where nothing is connected.
    """
    output = find_output(tree, output_type)
    if output is None:
        return BLACK, ()
    evaluator = Evaluator(owner, images, NODE_READERS)
    surface = evaluate_surface(output.inputs["Surface"], (), evaluator)
    if "Volume" in output.inputs and find_source(output.inputs["Volume"], ()).node is not None:
        evaluator.warn(output, "volume is not rendered yet")
    return surface.emission, tuple(evaluator.warnings)


def _warn_blended(surface: Surface, node: Node, evaluator: Evaluator) -> None:
    alpha = unit(as_value(surface.alpha.factor))
    if round(alpha, 3) in {0.0, 1.0}:
        return
    shown = "left out" if alpha < RenderSettings.alpha_threshold else "drawn opaque"
    evaluator.warn(node, f"blended transparency is not rendered yet; with an alpha of {alpha:.2g} it is {shown}")


def _default() -> MaterialRecord:
    """What Cycles shows in an empty slot: a plain Principled BSDF since Blender 5.0, before that a diffuse one."""
    material = Material(key=DEFAULT_MATERIAL, name="(empty slot)", version=new_version())
    if bpy.app.version < (5, 0, 0):
        material = replace(material, specular=0.0)
    return MaterialRecord(material, None, ())


def _without_nodes(key: str, material: bpy.types.Material) -> MaterialRecord:
    red, green, blue, _ = material.diffuse_color
    mirrored = Material(
        key=key,
        name=material.name,
        version=new_version(),
        base_color=(red, green, blue),
        specular=0.0,
    )
    text = f"Material “{material.name}” has no nodes; a diffuse surface of its viewport colour is shown."
    return MaterialRecord(mirrored, None, (text,))


def _material(key: str, material: bpy.types.Material, surface: Surface) -> Material:
    """Everything of `surface` but its textures."""
    return Material(
        key=key,
        name=material.name,
        version=new_version(),
        base_color=surface.base_color.factor,
        alpha=unit(as_value(surface.alpha.factor)),
        metallic=surface.metallic,
        roughness=surface.roughness,
        diffuse_roughness=surface.diffuse_roughness,
        specular=surface.specular,
        emission=surface.emission,
        emission_sampling=_emission_sampling(material),
    )


def _emission_sampling(material: Any) -> EmissionSampling:
    """Cycles' own setting of the material; its default where that add-on is disabled."""
    settings = getattr(material, "cycles", None)
    return EmissionSampling.AUTO if settings is None else EmissionSampling(settings.emission_sampling)
