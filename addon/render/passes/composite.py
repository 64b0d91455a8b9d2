# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of one sample, added to the film: radiance over background, or a debug view; and the mean passes."""

from collections.abc import Iterator
from itertools import combinations

from ...scene import Channel, DebugView, SunDisc
from ..environment import ENVIRONMENT_DEFINE, ENVIRONMENT_UNIFORMS, MAP_SAMPLER, environment_uniforms
from ..plan import SUM_CHANNELS, PlannedPass, film_target
from ..programs import ProgramSpec
from ..uniforms import UniformBlock
from .base import Frame, subsets
from .fullscreen import FullscreenPass, fullscreen_program

SUN_DISC_UNIFORMS = (
    ("sun_direction", "vec4"),  # and half_angle
    ("sun_zenith", "vec4"),  # and horizon
    ("sun_lowest", "vec4"),  # and lowest_elevation
    ("sun_highest", "vec4"),  # and limb_darkening
)

COMPOSITE_UNIFORMS = UniformBlock(
    "CompositeUniforms",
    (
        *ENVIRONMENT_UNIFORMS,
        *SUN_DISC_UNIFORMS,
        ("world_seen", "int"),  # whether the camera sees the world
        ("opaque", "int"),  # whether there is a background
        ("shown_layer", "int"),
    ),
)

MOST_TARGETS = 8
"""Images that a fragment shader writes at once: what every OpenGL 4.1 can."""


class CompositePass(FullscreenPass):
    """Writes the film."""

    name = "composite"
    block = COMPOSITE_UNIFORMS

    @classmethod
    def variants(cls) -> Iterator[ProgramSpec]:
        """Radiance, black or a debug view; every pair of mean passes and all of them, with and without what they read.

        Passes do not depend on one another nor on what the picture shows; the sun's disc is only in the background.
        """
        shown = [{"DIRECT"}, set[str](), *({f"DEBUG_{view.value}"} for view in DebugView if view is not DebugView.NONE)]
        passes = [f"FILM_{channel.value}" for channel in SUM_CHANNELS if channel is not Channel.COMBINED]
        films = [set(passes), *(set(pair) for pair in combinations(passes, 2)), *({name} for name in passes)]
        yield from (_program(frozenset(view)) for view in shown)
        for film in films:
            for read in subsets(("SPECULAR", "DIFFUSE_ROUGHNESS", "PHONG", "SPLIT", "ENVIRONMENT")):
                yield _program(read | film | {"DIRECT"})
        for background in subsets(("ENVIRONMENT", "FILM_ENVIRONMENT")):
            yield _program(background | {"DIRECT", "SUN_DISC"})
        for surface in subsets(("SPECULAR", "DIFFUSE_ROUGHNESS", "PHONG", "DIRECT", "FILM_DIFFUSE_INDIRECT")):
            yield _program(surface | {"INDIRECT", "ADD_INDIRECT"})
        yield _program(frozenset({"INDIRECT", "DEBUG_DEPTH", "FILM_DIFFUSE_INDIRECT"}))
        yield _program(frozenset({"INDIRECT", "FILM_DIFFUSE_INDIRECT"}), (Channel.DIFFUSE_INDIRECT,))

    def run(self, frame: Frame, planned: PlannedPass) -> None:
        """Add one sample to the film."""
        # A preview is only shown until there is something better: the world shines through walls in it.
        lit = any(name.startswith("direct.") for name in planned.reads)
        over = lit and frame.lighting.plan.preview and frame.sample.index == 1
        sums = [channel for channel in SUM_CHANNELS if film_target(channel) in planned.writes]
        frame.film.begin_sample(over=over)
        for first in range(0, len(sums), MOST_TARGETS):
            self._add(frame, planned, tuple(sums[first : first + MOST_TARGETS]))

    def _add(self, frame: Frame, planned: PlannedPass, sums: tuple[Channel, ...]) -> None:
        spec = _program(planned.defines, sums)
        frame.film.bind(frame.pool.framebuffer(tuple((film_target(channel).name, 0) for channel in sums)))
        self._fullscreen.bind(frame, spec, planned)
        debug = frame.settings.debug_view is not DebugView.NONE
        world = frame.scene.world
        if ENVIRONMENT_DEFINE in spec.defines and world.environment is not None:
            frame.environment.bind(world.environment, spec)
        self._fullscreen.draw(
            spec,
            **environment_uniforms(world),
            **_sun_disc_uniforms(world.sun_disc),
            world_seen=int(world.seen_by_camera),
            opaque=int(not debug and not frame.settings.transparent_film),
            shown_layer=min(frame.settings.debug_layer, frame.plan.layers - 1) if debug else 0,
        )


def _sun_disc_uniforms(disc: SunDisc | None) -> dict[str, object]:
    """Values of `SUN_DISC_UNIFORMS`; without a disc nothing reads them."""
    if disc is None:
        return dict.fromkeys((name for name, _ in SUN_DISC_UNIFORMS), 0.0)
    return {
        "sun_direction": (*disc.direction, disc.half_angle),
        "sun_zenith": (*disc.zenith, disc.horizon),
        "sun_lowest": (*disc.lowest, disc.lowest_elevation),
        "sun_highest": (*disc.highest, disc.limb_darkening),
    }


def _define(channel: Channel) -> str:
    return f"FILM_{channel.value}"


def _program(defines: frozenset[str], sums: tuple[Channel, ...] | None = None) -> ProgramSpec:
    """The program that adds up some of the sums that the defines ask for; None: all of them."""
    if sums is None:
        sums = tuple(channel for channel in SUM_CHANNELS if channel is Channel.COMBINED or _define(channel) in defines)
    others = {_define(channel) for channel in SUM_CHANNELS}
    defines = (defines - others) | {_define(channel) for channel in sums}
    outputs = "".join(
        f"layout(location = {index}) out vec4 out_{channel.value.lower()};\n" for index, channel in enumerate(sums)
    )
    return fullscreen_program(
        "composite/composite.frag",
        COMPOSITE_UNIFORMS,
        defines,
        samplers=(MAP_SAMPLER,),
        generated=(("outputs", outputs),),
    )
