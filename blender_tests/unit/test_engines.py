# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py render --set`: text becomes a value of the property's own type, or an error that says what is allowed."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from addon.report.engines import assign, parse


def prop(kind, **more):
    """A stand-in for a Blender property description."""
    description = {
        "identifier": "thing",
        "type": kind,
        "is_readonly": False,
        "is_array": False,
        "is_enum_flag": False,
        "hard_min": -1e9,
        "hard_max": 1e9,
    }
    return SimpleNamespace(**(description | more))


def items(*names):
    """A stand-in for the items of an enumeration."""
    return [SimpleNamespace(identifier=name) for name in names]


@given(st.integers(-(10**9), 10**9))
def test_whole_numbers(number):
    assert parse(prop("INT"), str(number)) == number


@given(st.floats(-1e9, 1e9, allow_nan=False))
def test_numbers(number):
    assert parse(prop("FLOAT"), repr(number)) == number


@given(st.text())
def test_any_text_is_a_string(text):
    assert parse(prop("STRING"), text) == text


@given(st.text())
def test_any_text_is_a_number_within_limits_or_an_error_that_names_the_property(text):
    def value_or_message():
        try:
            return parse(prop("FLOAT", hard_min=0.0, hard_max=1.0), text)
        except ValueError as error:
            return str(error)

    outcome = value_or_message()
    assert "thing" in outcome if isinstance(outcome, str) else 0.0 <= outcome <= 1.0


@pytest.mark.parametrize(("text", "value"), [("true", True), ("On", True), ("0", False), ("no", False)])
def test_booleans(text, value):
    assert parse(prop("BOOLEAN"), text) is value


@pytest.mark.parametrize(
    ("description", "text", "message"),
    [
        (prop("BOOLEAN"), "maybe", "true or false"),
        (prop("INT"), "1.5", "whole number"),
        (prop("FLOAT", hard_max=2.0), "3", "to 2, not 3"),
        (prop("FLOAT"), "nan", "not nan"),
        (prop("ENUM", enum_items=items("A", "B")), "C", "one of A, B"),
        (prop("FLOAT", is_array=True, array_length=3), "1,2", "3 values"),
    ],
)
def test_what_is_not_allowed_is_refused_by_name(description, text, message):
    with pytest.raises(ValueError, match=message):
        parse(description, text)


def test_vectors_and_sets():
    assert parse(prop("FLOAT", is_array=True, array_length=2), "1,2.5") == [1.0, 2.5]
    assert parse(prop("ENUM", is_enum_flag=True, enum_items=items("A", "B")), "A,B") == {"A", "B"}


def test_an_unknown_name_lists_the_known_ones():
    properties = [prop("INT", identifier="layers"), prop("POINTER", identifier="rna_type")]
    group = SimpleNamespace(bl_rna=SimpleNamespace(identifier="Settings", properties=properties))
    assign(group, "layers", "3")
    assert group.layers == 3
    with pytest.raises(ValueError, match=r"Settings has no property 'lairs'; did you mean layers\?"):
        assign(group, "lairs", "3")


def test_dots_lead_to_groups_within_groups():
    inner = SimpleNamespace(bl_rna=SimpleNamespace(identifier="Numbers", properties=[prop("INT", identifier="rays")]))
    properties = [prop("POINTER", identifier="render"), prop("POINTER", identifier="rna_type")]
    outer = SimpleNamespace(bl_rna=SimpleNamespace(identifier="Settings", properties=properties), render=inner)
    assign(outer, "render.rays", "3")
    assert inner.rays == 3
    with pytest.raises(ValueError, match=r"Numbers has no property 'ray'; did you mean rays\?"):
        assign(outer, "render.ray", "3")
    with pytest.raises(ValueError, match=r"Settings has no settings 'rnder'; did you mean render\?"):
        assign(outer, "rnder.rays", "3")
    with pytest.raises(ValueError, match=r"Settings has no settings 'rna_type'; it has render\."):
        assign(outer, "rna_type.rays", "3")
    with pytest.raises(ValueError, match=r"Settings has no property 'render'; it has none\."):
        assign(outer, "render", "3")
