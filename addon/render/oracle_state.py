# SPDX-License-Identifier: GPL-3.0-or-later
"""What the oracle texture shows, from one picture to the next."""

from collections.abc import Hashable
from dataclasses import dataclass

from ..scene import Camera, Moment


@dataclass
class OracleState:
    """`moment`: the scene, and the camera with its jitter, whose layers the oracle texture shows; None for nothing.
    `layers`: how many of them. `view`: the same camera before jitter.
    `valid_for`: what the texture's layout and contents depend on besides.
    """

    moment: Moment | None = None
    view: Camera | None = None
    layers: int = 0
    valid_for: Hashable = None

    def begin(self, valid_for: Hashable, *, continuous: bool) -> None:
        """Forget what an earlier picture left, unless this one continues it with the same settings."""
        if not continuous or valid_for != self.valid_for:
            self.forget()
        self.valid_for = valid_for

    def forget(self) -> None:
        """Nothing is known."""
        self.moment, self.view, self.layers = None, None, 0

    def show(self, moment: Moment, view: Camera, layers: int) -> None:
        """The texture shows this now."""
        self.moment, self.view, self.layers = moment, view, layers

    def shows(self, moment: Moment) -> bool:
        """Whether the texture shows exactly this."""
        held = self.moment
        return held is not None and held.scene is moment.scene and held.camera.sees_as(moment.camera)

    def has_moved(self, moment: Moment) -> bool:
        """Whether anything but the sub-pixel jitter differs between what the texture shows and an unjittered moment."""
        assert self.moment is not None
        assert self.view is not None
        return self.moment.scene is not moment.scene or not self.view.sees_as(moment.camera)
