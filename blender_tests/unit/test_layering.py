# SPDX-License-Identifier: GPL-3.0-or-later
"""Which way of reaching several layers in one pass is taken."""

from types import SimpleNamespace

import pytest

from addon.render import RenderError, ShaderError
from addon.render.layering import Trial, resolved
from addon.scene import Layering, RenderSettings, Variant

VERTEX, GEOMETRY = Layering.VERTEX_SHADER, Layering.GEOMETRY_SHADER


def device(extension="GL_ARB_shader_viewport_layer_array"):
    return SimpleNamespace(vertex_layer_extension=extension, fastest_layering=None)


def attempts(vertex, geometry, separate=b"bits"):
    """What trials give, and a list that counts them."""
    counted = []

    def attempt(settings):
        counted.append(settings.layering)
        if settings.variant is Variant.TWO_PASS:
            return Trial(9.0, separate)
        return {VERTEX: vertex, GEOMETRY: geometry}[settings.layering]

    return attempt, counted


def choose(on, attempt, layering=Layering.FASTEST):
    return resolved(RenderSettings(8, 8, layering=layering), on, attempt)


@pytest.mark.parametrize(
    ("vertex", "geometry", "chosen"),
    [
        (Trial(2.0, b"bits"), Trial(1.0, b"bits"), GEOMETRY),
        (Trial(1.0, b"bits"), Trial(2.0, b"bits"), VERTEX),
        (Trial(2.0, b"bits"), Trial(1.0, b"other"), VERTEX),
        (Trial(1.0, b"other"), Trial(2.0, b"bits"), GEOMETRY),
        (Trial(1.0, b"other"), Trial(2.0, b"others"), VERTEX),
    ],
)
def test_the_faster_of_those_that_round_as_separate_passes_is_taken(vertex, geometry, chosen):
    attempt, _ = attempts(vertex, geometry)
    assert choose(device(), attempt) is chosen


def test_a_way_that_the_driver_cannot_compile_is_not_taken():
    def attempt(settings):
        if settings.layering is VERTEX and settings.variant is not Variant.TWO_PASS:
            raise ShaderError("refused")
        return Trial(9.0, b"bits")

    assert choose(device(), attempt) is GEOMETRY


def test_it_is_measured_once_and_remembered():
    on = device()
    attempt, counted = attempts(Trial(2.0, b"bits"), Trial(1.0, b"bits"))
    assert choose(on, attempt) is choose(on, attempt) is GEOMETRY
    assert len(counted) == 3


def test_what_is_asked_for_is_not_measured():
    attempt, counted = attempts(Trial(2.0, b"bits"), Trial(1.0, b"bits"))
    assert choose(device(), attempt, VERTEX) is VERTEX
    assert choose(device(None), attempt, GEOMETRY) is GEOMETRY
    assert choose(device(None), attempt) is GEOMETRY
    with pytest.raises(RenderError, match="gl_Layer"):
        choose(device(None), attempt, VERTEX)
    assert not counted
