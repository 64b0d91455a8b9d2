# SPDX-License-Identifier: GPL-3.0-or-later
"""What the oracle's textures show, from one picture to the next."""

from collections.abc import Hashable
from dataclasses import dataclass, field

from ..scene import Moment
from .plan import HISTORY_TARGET, ORACLE_TARGET


@dataclass(frozen=True)
class ShownLayers:
    """Whose layers a texture shows, through the camera with its jitter, and how many of them, nearest first.

    `exact`: how many are those of that moment; the others were found with the depth of another one.
    """

    moment: Moment
    layers: int
    exact: int


@dataclass
class OracleState:
    """`targets`: what each texture shows, by name. `source`: the one that this sample's layers are tested against.
    `valid_for`: what layout and contents depend on besides.
    """

    targets: dict[str, ShownLayers] = field(default_factory=dict[str, ShownLayers])
    source: str = ORACLE_TARGET
    valid_for: Hashable = None

    def begin(self, valid_for: Hashable, *, continuous: bool) -> None:
        """Forget what an earlier picture left, unless this one continues it with the same settings."""
        if not continuous or valid_for != self.valid_for:
            self.targets.clear()
        self.valid_for = valid_for

    @property
    def history(self) -> Moment | None:
        """What the last view left."""
        shown = self.targets.get(HISTORY_TARGET)
        return shown.moment if shown else None

    @property
    def shown(self) -> ShownLayers:
        """What the source shows."""
        return self.targets[self.source]

    def show(self, target: str, moment: Moment, layers: int, exact: int | None = None) -> None:
        """A texture shows this now."""
        self.targets[target] = ShownLayers(moment, layers, layers if exact is None else exact)

    def complete(self, layers: int, *, exact: bool) -> None:
        """The source has all its layers now."""
        self.show(self.source, self.shown.moment, layers, layers if exact else self.shown.exact)

    def shows(self, target: str, moment: Moment) -> bool:
        """Whether a texture shows exactly this, as far as it does."""
        held = self.targets.get(target)
        return held is not None and held.moment.equals(moment)

    def is_exact(self, moment: Moment) -> bool:
        """Whether all layers of the source are those of a moment."""
        return self.shown.moment.equals(moment) and self.shown.exact == self.shown.layers
