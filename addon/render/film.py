# SPDX-License-Identifier: GPL-3.0-or-later
"""The film: sums of samples in float32, read back as means."""

import moderngl
import numpy as np

from ..scene import Channel
from ..scene.arrays import Float32Array
from .device import Device
from .plan import film_target
from .targets import TexturePool

CHANNEL_COMPONENTS = {
    Channel.COMBINED: 4,
    Channel.DEPTH: 1,
    Channel.NORMAL: 3,
    Channel.POSITION: 3,
    Channel.DIFFUSE_COLOR: 3,
    Channel.OBJECT_INDEX: 1,
    Channel.GLOSSY_COLOR: 3,
    Channel.DIFFUSE_DIRECT: 3,
    Channel.GLOSSY_DIRECT: 3,
    Channel.EMISSION: 3,
    Channel.ENVIRONMENT: 3,
    Channel.DIFFUSE_INDIRECT: 3,
}


class Film:
    """Accumulates the samples of one view. Its sums are targets of the view's texture pool."""

    def __init__(self, device: Device) -> None:
        self._context = device.context
        self.samples = 0
        self._summed = 0

    def begin_sample(self, *, over: bool = False) -> None:
        """Go on to a sample; the first one clears the sums, and any that starts `over`."""
        if self.samples == 0 or over:
            self._summed = 0
        self._summed += 1

    def bind(self, framebuffer: moderngl.Framebuffer) -> None:
        """Bind some of the sums, so that what is drawn is added to them."""
        framebuffer.use()
        if self._summed == 1:
            framebuffer.clear()
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE

    def mean(self, pool: TexturePool, channel: Channel) -> Float32Array:
        """The mean over the samples since the sums were last cleared, (H, W, C) float32, row 0 at the bottom."""
        width, height = pool.picture_size
        sums = np.frombuffer(pool.read(film_target(channel).name), np.float32).reshape(height, width, 4)
        return sums[..., : CHANNEL_COMPONENTS[channel]] / np.float32(max(self._summed, 1))
