# SPDX-License-Identifier: GPL-3.0-or-later
"""Mirrors Blender's images as arrays of pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ...scene import Image
from ...scene.arrays import Float32Array, UInt8Array, same_array
from ..changes import Messages, new_version
from ..keys import id_key
from .graph import Node

RGBA = tuple[float, float, float, float]

_NO_IMAGE = "image.none"
_MAGENTA = np.array([[[255, 0, 255, 255]]], np.uint8)
_LINEAR_SPACES = frozenset({"Linear", "Linear Rec.709", "Raw", "Non-Color", "Generic Data"})


@dataclass(frozen=True)
class ImageRecord:
    """A mirrored image; `signature` tells whether its pixels may have changed. `mean` is linear RGBA.

    `transparent`: some alpha is below 1, and it is meant as the colour's opacity.
    """

    signature: tuple[object, ...]
    image: Image
    mean: RGBA
    warnings: tuple[str, ...] = ()
    transparent: bool = False


class ImageTable:
    """The images that materials read, kept between syncs.

    Pixels are read again when the image's signature changes, when it was painted on, or when Blender says that
    it was updated: its flags over-report, so they are only ever asked whether to do more.
    """

    def __init__(self) -> None:
        self._previous: dict[str, ImageRecord] = {}
        self._current: dict[str, ImageRecord] = {}
        self._updated: frozenset[str] = frozenset()
        self._messages = Messages()

    def begin(self, updated: frozenset[str], messages: Messages) -> None:
        """Start a sync: `updated` keys are read again, texts go to `messages`."""
        self._previous = self._current
        self._current = {}
        self._updated = updated
        self._messages = messages

    def collect(self, keys: Iterable[str]) -> dict[str, Image]:
        """The images with these keys, which must all have been mirrored since `begin`."""
        return {key: self._current[key].image for key in sorted(keys)}

    def mirror(self, node: Node, owner: str) -> ImageRecord:
        """The record of the image that a texture node shows; `owner` begins texts about the node.

        As in Cycles, encoded colours are multiplied by alpha where the node's Alpha output is not used.
        """
        record = self._mirror_image(node, owner)
        alpha = node.outputs.get("Alpha")
        if record.transparent and alpha is not None and not alpha.is_linked:
            return self._premultiplied(record.image)
        return record

    def _mirror_image(self, node: Node, owner: str) -> ImageRecord:
        if node.image is None:
            text = f"{owner}, node “{node.name}” has no image; magenta is shown instead."
            self._messages.add(owner, node.name, text)
            return self._current.setdefault(_NO_IMAGE, self._previous.get(_NO_IMAGE) or _magenta(_NO_IMAGE, "none", ()))
        image = node.image.original
        key = id_key("image", image)
        record = self._current.get(key)
        if record is None:
            record = self._previous.get(key)
            signature = _signature(image)
            if record is None or record.signature != signature or image.is_dirty or key in self._updated:
                record = _read(key, image, signature, record)
            self._current[key] = record
        self._messages.extend(key, record.warnings)
        return record

    def with_mask(self, color: Image | None, mask: Image, component: str) -> Image:
        """An image with the colours of `color` (white if None) and a component of `mask` as its alpha.

        `component`: LUMINANCE, RED, GREEN, BLUE, ALPHA or INVERTED_ALPHA.
        """
        key = f"{color.key if color else 'white'}+{mask.key}.{component}"
        signature = (color and color.version, mask.version)
        return self._derived(key, signature, lambda: _masked(key, color, mask, component)).image

    def as_grey(self, image: Image, component: str) -> Image:
        """An opaque image whose three colours are one component of `image` (see `with_mask`)."""
        key = f"{image.key}.{component}"
        return self._derived(key, (image.version,), lambda: _greyed(key, image, component)).image

    def _premultiplied(self, image: Image) -> ImageRecord:
        key = f"{image.key}.premultiplied"
        return self._derived(key, (image.version,), lambda: _premultiply(key, image))

    def _derived(self, key: str, signature: tuple[object, ...], make: Callable[[], Image]) -> ImageRecord:
        """An image made from others, made anew only when their versions (`signature`) change."""
        record = self._current.get(key) or self._previous.get(key)
        if record is None or record.signature != signature:
            image = make()
            record = ImageRecord(signature, image, _mean(image))
        self._current[key] = record
        return record


def _signature(image: Any) -> tuple[object, ...]:
    return (
        image.name,
        image.filepath,
        image.source,
        image.colorspace_settings.name,
        image.alpha_mode,
        image.is_float,
        image.is_dirty,
        image.packed_file is not None,
        image.generated_type,
        (image.generated_width, image.generated_height),
        tuple(image.generated_color),
        tuple(image.size),
        len(image.tiles),
    )


def _magenta(key: str, name: str, signature: tuple[object, ...], warnings: tuple[str, ...] = ()) -> ImageRecord:
    image = Image(key=key, name=name, version=new_version(), pixels=_MAGENTA, srgb=True)
    return ImageRecord(signature, image, (1.0, 0.0, 1.0, 1.0), warnings)


def _read(key: str, image: Any, signature: tuple[object, ...], previous: ImageRecord | None) -> ImageRecord:
    width, height = image.size
    if width == 0 or height == 0 or len(image.pixels) == 0:
        where = f" ({image.filepath})" if image.filepath else ""
        text = f"Image “{image.name}”{where} is missing or cannot be read; magenta is shown instead."
        if previous is not None and previous.warnings == (text,):
            return previous
        return _magenta(key, image.name, signature, (text,))
    width, height = image.size  # known only once the pixels were asked for
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    values = _four_channels(values.reshape(height, width, -1), image)
    space = image.colorspace_settings.name
    pixels = values if image.is_float else np.rint(values * np.float32(255.0)).astype(np.uint8)
    srgb = not image.is_float and not image.colorspace_settings.is_data and space not in _LINEAR_SPACES
    warnings = _limitations(image, srgb)
    transparent = _has_opacity(image) and bool((values[..., 3] < 1.0).any())
    if previous is not None and _same_image(previous.image, image.name, pixels, srgb):
        return ImageRecord(_signature(image), previous.image, previous.mean, warnings, transparent)
    mirrored = Image(key=key, name=image.name, version=new_version(), pixels=pixels, srgb=srgb)
    return ImageRecord(_signature(image), mirrored, _mean(mirrored), warnings, transparent)


def _same_image(image: Image, name: str, pixels: UInt8Array | Float32Array, srgb: bool) -> bool:
    return image.name == name and image.srgb == srgb and same_array(image.pixels, pixels)


def _limitations(image: Any, srgb: bool) -> tuple[str, ...]:
    texts = []
    if image.source == "TILED" and len(image.tiles) > 1:
        texts.append(f"Image “{image.name}” has {len(image.tiles)} UDIM tiles; only the first is rendered yet.")
    if image.source in {"SEQUENCE", "MOVIE"}:
        texts.append(f"Image “{image.name}” is a {image.source.lower()}; it stands still for now.")
    space = image.colorspace_settings.name
    if srgb and space != "sRGB":
        texts.append(f"Image “{image.name}” has the colour space “{space}”; it is read as sRGB.")
    return tuple(texts)


def _four_channels(values: Float32Array, image: Any) -> Float32Array:
    """(H, W, 4) with straight alpha, as `image.alpha_mode` asks."""
    height, width, channels = values.shape
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = values[..., :1] if channels < 3 else values[..., :3]
    if channels in {2, 4} and image.alpha_mode != "NONE":
        pixels[..., 3] = values[..., -1]
    if _has_opacity(image) and _is_stored_premultiplied(image) and (pixels[..., 3] != 1.0).any():
        alpha = pixels[..., 3:]
        np.divide(pixels[..., :3], alpha, out=pixels[..., :3], where=alpha > 0.0)
    if not image.is_float:
        np.clip(pixels, 0.0, 1.0, out=pixels)
    if not np.isfinite(pixels).all():
        pixels = np.nan_to_num(pixels, nan=0.0, posinf=0.0, neginf=0.0)
    return pixels


def _has_opacity(image: Any) -> bool:
    """Whether alpha is the opacity of the colours, not just a fourth channel; never so for data."""
    return image.alpha_mode in {"STRAIGHT", "PREMUL"} and not image.colorspace_settings.is_data


def _is_stored_premultiplied(image: Any) -> bool:
    """Whether pixels come multiplied by alpha: before 5.0 by how they are stored, since then as the image says."""
    return image.is_float if bpy.app.version < (5, 0, 0) else image.alpha_mode == "PREMUL"


def linear(image: Image) -> Float32Array:
    """(H, W, 4) float32 scene-linear colour and alpha of an image."""
    pixels: Any = image.pixels
    if pixels.dtype == np.float32:
        return pixels
    levels = np.arange(256, dtype=np.float32) / np.float32(255.0)
    decoded = levels
    if image.srgb:
        decoded = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4).astype(np.float32)
    values = decoded[pixels]
    values[..., 3] = levels[pixels[..., 3]]
    return values


def _mean(image: Image) -> RGBA:
    step = max(1, int((image.pixels.shape[0] * image.pixels.shape[1] / 65536) ** 0.5))
    thinned = Image(image.key, image.name, image.version, image.pixels[::step, ::step], image.srgb)
    red, green, blue, alpha = linear(thinned).reshape(-1, 4).mean(axis=0, dtype=np.float64)
    return float(red), float(green), float(blue), float(alpha)


def _masked(key: str, color: Image | None, mask: Image, component: str) -> Image:
    """See `ImageTable.with_mask`; where sizes differ, texels are repeated up to the larger one, per axis."""
    source = mask if color is None else color
    height = max(source.pixels.shape[0], mask.pixels.shape[0])
    width = max(source.pixels.shape[1], mask.pixels.shape[1])
    alpha = _component(mask, component)
    pixels = _repeat(source.pixels, height, width).copy()
    one = np.float32(1.0) if pixels.dtype == np.float32 else np.float32(255.0)
    if color is None:
        pixels[..., :3] = one
    mask_values = np.clip(_repeat(alpha, height, width), 0.0, 1.0) * one
    pixels[..., 3] = mask_values if pixels.dtype == np.float32 else np.rint(mask_values).astype(np.uint8)
    return Image(
        key=key, name=f"{source.name} with {mask.name}", version=new_version(), pixels=pixels, srgb=source.srgb
    )


def _greyed(key: str, image: Image, component: str) -> Image:
    """See `ImageTable.as_grey`; encoded as `image` is, alpha never."""
    srgb = image.srgb and "ALPHA" not in component
    values = _component(image, component)
    pixels = np.ones((*values.shape, 4), np.float32)
    pixels[..., :3] = (_srgb_encoded(values) if srgb else values)[..., None]
    if image.pixels.dtype == np.uint8:
        pixels = np.rint(pixels * np.float32(255.0)).astype(np.uint8)
    name = f"{component.lower().replace('_', ' ')} of {image.name}"
    return Image(key=key, name=name, version=new_version(), pixels=pixels, srgb=srgb)


def _component(image: Image, component: str) -> Float32Array:
    """(H, W) float32 one linear channel of an image, or its luminance."""
    channels = linear(image)
    if component == "LUMINANCE":
        return channels[..., :3] @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    if component == "INVERTED_ALPHA":
        return np.float32(1.0) - channels[..., 3]
    return channels[..., ("RED", "GREEN", "BLUE", "ALPHA").index(component)]


def _srgb_encoded(values: Float32Array) -> Float32Array:
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1.0 / 2.4) - 0.055).astype(np.float32)


def _premultiply(key: str, image: Image) -> Image:
    """An opaque image whose colours, as encoded, are multiplied by the alpha they had."""
    one = np.float32(1.0) if image.pixels.dtype == np.float32 else np.float32(255.0)
    values = image.pixels.astype(np.float32)
    values[..., :3] *= values[..., 3:] / one
    values[..., 3] = one
    pixels = values if image.pixels.dtype == np.float32 else np.rint(values).astype(np.uint8)
    return Image(key=key, name=image.name, version=new_version(), pixels=pixels, srgb=image.srgb)


def _repeat(values: Any, height: int, width: int) -> Any:
    rows = np.arange(height) * values.shape[0] // height
    columns = np.arange(width) * values.shape[1] // width
    return values[rows[:, None], columns[None, :]]
