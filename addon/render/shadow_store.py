# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow maps on the GPU: one texture array for all, and what is kept in it from sample to sample and view to view."""

from collections.abc import Hashable, Iterable
from dataclasses import dataclass

import moderngl

from .atlas import AtlasLayout, Slot
from .device import Device, RenderError

TEXEL_BYTES = 8
_DEPTH_BYTES = 4


@dataclass
class _Entry:
    slot: Slot
    view: int  # number of the view that last used it
    used: int  # running number of its last use


class ShadowStore:
    """An atlas of maps by what they show. What is not used any more goes first where room is needed; then what this
    view drew last: its samples come round again in the same order, so that keeping the earlier ones saves most."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._texture: moderngl.TextureArray | None = None
        self._depth: int | None = None
        self._framebuffers: dict[int, moderngl.Framebuffer] = {}
        self._layout = AtlasLayout(1, 0)
        self._limit = 0
        self._entries: dict[Hashable, _Entry] = {}
        self._comes_round = False
        self._view = 0
        self._uses = 0
        self.drawn = 0
        self.kept = 0

    @property
    def texture(self) -> moderngl.TextureArray | None:
        """The pages, RG32UI: see `shaders/shadow_maps/shadow_maps.frag`; None while there are none."""
        return self._texture

    @property
    def capacity(self) -> int:
        """Texels that all pages together may have."""
        return self._limit * self._layout.page_size**2

    def begin_view(self, page_size: int, memory: int, *, comes_round: bool) -> None:
        """A new view begins: pages of `page_size` texels a side, as many as fit into `memory` bytes, at least one.

        `comes_round`: whether its samples will be drawn again, so that keeping their maps is worth memory. Otherwise it
        begins with none: where a map lies decides how it is rounded, and its picture must not depend on earlier ones.
        """
        layers = self._device.context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"]
        self._limit = min(max(memory // (TEXEL_BYTES * page_size**2), 1), layers)
        if not comes_round or page_size != self._layout.page_size or self._layout.pages > self._limit:
            self.release()
            self._layout = AtlasLayout(page_size, 0)
        self._comes_round = comes_round
        self._view += 1
        self.drawn = self.kept = 0

    def place(self, wanted: dict[Hashable, int]) -> tuple[dict[Hashable, Slot], set[Hashable]]:
        """Slots for the maps of one sample, of these sizes by key, and which of them must be drawn.

        Raises RenderError where memory does not suffice.
        """
        while (placed := self._place(wanted)) is None:
            self._make_room(sum(size * size for size in wanted.values()))
        slots, fresh = placed
        self.drawn += len(fresh)
        self.kept += len(wanted) - len(fresh)
        return slots, fresh

    def forget(self, keys: Iterable[Hashable]) -> None:
        """These were placed, but not drawn."""
        for key in keys:
            self._drop(key)

    def target(self, slot: Slot) -> moderngl.Framebuffer:
        """The page of a slot with hardware depth, where only the slot can be drawn to."""
        assert self._texture is not None
        if slot.page not in self._framebuffers:
            framebuffer = self._device.context.framebuffer([self._texture])
            if not self._device.raw.attach_layers(framebuffer, [(self._texture, slot.page)], self._depth):
                framebuffer.release()
                raise RenderError("The graphics driver cannot draw shadow maps.")
            self._framebuffers[slot.page] = framebuffer
        framebuffer = self._framebuffers[slot.page]
        framebuffer.viewport = framebuffer.scissor = (slot.x, slot.y, slot.size, slot.size)
        return framebuffer

    def bytes(self) -> int:
        """Bytes of video memory."""
        page = self._layout.page_size**2
        return page * (TEXEL_BYTES * self._layout.pages + (_DEPTH_BYTES if self._depth is not None else 0))

    def release(self) -> None:
        """Free everything."""
        self._device.no_framebuffer.use()
        for framebuffer in self._framebuffers.values():
            framebuffer.release()
        self._framebuffers.clear()
        if self._texture is not None:
            self._texture.release()
        if self._depth is not None:
            self._device.raw.delete_texture(self._depth)
        self._texture = self._depth = None
        self._entries.clear()
        self._layout = AtlasLayout(self._layout.page_size, 0)

    def _place(self, wanted: dict[Hashable, int]) -> tuple[dict[Hashable, Slot], set[Hashable]] | None:
        slots: dict[Hashable, Slot] = {}
        fresh: set[Hashable] = set()
        idle = [key for key in self._entries if key not in wanted]
        idle.sort(key=lambda key: self._eviction_rank(self._entries[key]), reverse=True)
        for key, size in sorted(wanted.items(), key=lambda item: -item[1]):  # large ones first: squares pack tightly
            entry = self._entries.get(key)
            if entry is None:
                slot = self._allocate(size, idle)
                if slot is None:
                    for lost in fresh:
                        self._drop(lost)
                    return None
                entry = self._entries[key] = _Entry(slot, self._view, 0)
                fresh.add(key)
            self._uses += 1
            entry.view, entry.used = self._view, self._uses
            slots[key] = entry.slot
        return slots, fresh

    def _allocate(self, size: int, idle: list[Hashable]) -> Slot | None:
        """A slot, where one is free or gets free by dropping the last of what is `idle`, as much as need be."""
        slot = self._layout.allocate(size)
        outdated = bool(idle) and self._entries[idle[-1]].view < self._view - 1
        may_grow = self._layout.pages < self._limit
        if may_grow and self._comes_round and not outdated:
            return slot
        while slot is None and idle:
            self._drop(idle.pop())
            slot = self._layout.allocate(size)
        return slot

    def _eviction_rank(self, entry: _Entry) -> tuple[int, int]:
        return (0, entry.used) if entry.view < self._view else (1, -entry.used)

    def _drop(self, key: Hashable) -> None:
        self._layout.release(self._entries.pop(key).slot)

    def _make_room(self, texels: int) -> None:
        """More pages, or where there are as many as may be, the same without gaps; what was drawn before is lost."""
        page = self._layout.page_size
        if self._layout.pages >= self._limit:
            if not self._entries:
                raise RenderError(
                    "Shadow maps do not fit into their memory. Raise Shadow Memory or lower Shadow Map Size."
                )
            self.forget(tuple(self._entries))
            return
        pages = min(max(2 * self._layout.pages, -(-texels // page**2) + 1), self._limit)
        self.release()
        try:
            self._texture = self._device.context.texture_array((page, page, pages), 2, dtype="u4")
        except moderngl.Error as error:
            raise _out_of_memory(page, pages) from error
        self._texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth = self._device.raw.new_depth_array(page, page, 1)
        if self._device.out_of_memory():
            self.release()
            raise _out_of_memory(page, pages)
        self._layout = AtlasLayout(page, pages)


def _out_of_memory(page: int, pages: int) -> RenderError:
    size = page * page * (pages * TEXEL_BYTES + _DEPTH_BYTES) / 2**20
    return RenderError(
        f"Out of graphics memory for shadow maps ({size:.0f} MiB). Lower Shadow Memory or Shadow Map Size."
    )
