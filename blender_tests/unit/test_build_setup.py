# SPDX-License-Identifier: GPL-3.0-or-later
"""Set-up: interpreters, the cache, lock files, apt's sources, where pictures go."""

import re
import sys
import tomllib
from pathlib import Path

import pytest

from tooling import blender_window, environments, packaging, places, pythons, rendering
from tooling.console import ToolError

MINOR = sys.version_info[1]


def executable_file(path, text):
    """A script that can be run."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


@pytest.fixture
def lonely_home(tmp_path, monkeypatch):
    """A home folder and PATH with no interpreter."""
    for name in ("PYENV_ROOT", "UV_PYTHON_INSTALL_DIR", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "none"))
    return tmp_path


@pytest.mark.parametrize("place", [f".pyenv/versions/3.{MINOR}.7", f".local/share/uv/python/cpython-3.{MINOR}.7-linux"])
def test_a_shim_that_refuses_is_passed_over_for_a_real_interpreter(lonely_home, place, monkeypatch):
    interpreter = Path(sys.base_prefix) / "bin" / f"python3.{MINOR}"
    executable_file(lonely_home / "bin" / f"python3.{MINOR}", "#!/bin/sh\nexit 127\n")
    executable_file(lonely_home / place / "bin" / f"python3.{MINOR}", f'#!/bin/sh\nexec {interpreter} "$@"\n')
    found = pythons.find.__wrapped__(3, MINOR)
    assert found is not None
    assert found.path == lonely_home / place / "bin" / f"python3.{MINOR}"
    assert found.version[:2] == (3, MINOR)


def test_no_interpreter_is_found_where_none_is(lonely_home):
    assert pythons.find.__wrapped__(3, MINOR) is None


def test_a_missing_python_is_named_with_a_way_to_get_it():
    line = environments.missing_python(list(environments.BLENDERS))
    assert "Python 3.13 or 3.11" in line
    assert "uv python install 3.13" in line
    assert "\n" not in line


def test_a_cached_folder_is_made_once_and_never_half(tmp_path, monkeypatch):
    monkeypatch.setenv("DEEP_GBUFFER_CACHE", str(tmp_path))
    made = []

    def make(folder):
        (folder / "half").touch()
        made.append(folder)
        if len(made) == 1:
            raise ToolError("the network went away")
        (folder / "whole").touch()

    with pytest.raises(ToolError):
        places.cached("kind/name", lambda _: True, make)
    assert [path.name for path in (tmp_path / "kind").iterdir() if path.is_dir()] == []
    first = places.cached("kind/name", lambda _: True, make)
    assert (first / "whole").exists()
    assert places.cached("kind/name", lambda _: True, make) == first
    assert len(made) == 2


def test_a_cached_folder_that_stopped_working_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("DEEP_GBUFFER_CACHE", str(tmp_path))
    place = places.cached("name", lambda _: True, lambda folder: (folder / "interpreter").touch())
    (place / "interpreter").unlink()
    again = places.cached(
        "name", lambda folder: (folder / "interpreter").exists(), lambda folder: (folder / "interpreter").touch()
    )
    assert (again / "interpreter").exists()


def test_a_file_is_replaced_by_a_whole_one_or_not_at_all(tmp_path):
    path = tmp_path / "new" / "picture.png"
    with places.replacing(path) as draft:
        assert draft.suffix == ".png"
        draft.write_text("first", encoding="utf-8")
        assert not path.exists()
    with pytest.raises(UnicodeEncodeError), places.replacing(path) as draft:
        draft.write_text("half\udc00", encoding="utf-8")
    assert path.read_text(encoding="utf-8") == "first"
    assert list(path.parent.iterdir()) == [path]


def test_a_finished_picture_that_cannot_be_put_in_place_is_named(tmp_path):
    source, target = tmp_path / "scratch.png", tmp_path / "out.png"
    source.write_bytes(b"picture")
    target.mkdir()
    with pytest.raises(ToolError, match=r"out\.png could not be written: "):
        rendering.put_in_place(source, target)
    target.rmdir()
    rendering.put_in_place(source, target)
    assert (target.read_bytes(), list(tmp_path.iterdir())) == (b"picture", [target])


def test_a_wheel_that_went_away_is_noticed(tmp_path):
    names = ["a-1-cp311-cp311-any.whl", "a-1-cp313-cp313-any.whl"]
    assert not packaging.has_all_wheels(tmp_path)
    (tmp_path / packaging.WHEEL_LIST).write_text("\n".join(names), encoding="utf-8")
    for name in names:
        (tmp_path / name).touch()
    assert packaging.has_all_wheels(tmp_path)
    (tmp_path / names[0]).unlink()
    assert not packaging.has_all_wheels(tmp_path)


def test_an_environment_is_used_without_asking_a_python_and_made_again_without_its_home(tmp_path, monkeypatch):
    monkeypatch.setenv("DEEP_GBUFFER_CACHE", str(tmp_path))
    monkeypatch.setattr(environments.system_packages, "provide", lambda _needs: None)
    monkeypatch.setattr(pythons, "probe", lambda path: pytest.fail(f"{path} was asked"))
    newest = environments.BLENDERS[0]
    environment = environments._place(f"blender-{newest.version}", newest.python)
    executable_file(environments.executable(environment), "")
    (environment / "pyvenv.cfg").write_text(f"home = {tmp_path}\nversion = 3.13.0\n", encoding="utf-8")
    assert environments.blender_python() == environments.executable(environment)
    (environment / "pyvenv.cfg").write_text(f"home = {tmp_path / 'gone'}\n", encoding="utf-8")
    monkeypatch.setattr(pythons, "find", lambda *_version: None)
    with pytest.raises(ToolError, match=newest.python_text):
        environments.blender_python(newest.version)


def test_keys_tell_the_parts_apart():
    assert places.key("ab", "c") != places.key("a", "bc")
    assert places.key("ab", "c") == places.key("ab", "c")


@pytest.mark.parametrize("lock_file", sorted(places.REQUIREMENTS.glob("*.txt")), ids=lambda path: path.stem)
def test_lock_files_pin_and_hash_every_package_and_name_no_host(lock_file):
    text = lock_file.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    assert lines
    assert all(re.match(r"[\w.\-\[\]]+==\S+", line) and "--hash=sha256:" in line for line in lines)
    assert "://" not in text


STANZA = "Types: deb\nURIs: http://two.example/debian/\nSuites: sid\nComponents: main\n"


@pytest.mark.parametrize(
    ("name", "text", "address"),
    [
        ("sources.list", "deb [arch=amd64] http://one.example/debian stable main\n", "http://one.example/debian"),
        ("sources.list", "# deb http://one.example/debian stable main\n", None),
        ("sources.list.d/debian.sources", STANZA, "http://two.example/debian/"),
        ("sources.list.d/off.sources", "Enabled: no\n" + STANZA, None),
        ("sources.list", "deb http://three.example/debian-security stable-security main\n", None),
        ("sources.list.d/other.list", "deb https://four.example/apt cloud-sdk main\n", None),
        ("sources.list", "deb http://five.example/ubuntu noble main\n", None),
    ],
)
def test_the_mirror_is_read_from_apts_sources(tmp_path, name, text, address):
    (tmp_path / "sources.list.d").mkdir()
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert blender_window.mirror(tmp_path) == address


def test_the_manifest_lists_platforms_and_wheels_before_its_tables():
    text = (packaging.ADD_ON / "blender_manifest.toml").read_text(encoding="utf-8")
    manifest = tomllib.loads(packaging.complete_manifest(text, ["linux-x64"], ["b.whl", "a.whl"]))
    assert manifest["platforms"] == ["linux-x64"]
    assert manifest["wheels"] == ["./wheels/a.whl", "./wheels/b.whl"]
    assert manifest["id"] == "deep_gbuffer"
    assert "files" in manifest["permissions"]


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("out.png", 7, "out0007.png"),
        ("out.png", -7, "out-0007.png"),
        ("out.png", 12345, "out12345.png"),
        ("a_##_b.exr", 7, "a_07_b.exr"),
        ("a#b##.png", 7, "a#b07.png"),
    ],
)
def test_frame_numbers_in_file_names_as_blender_puts_them(name, frame, expected):
    assert rendering.numbered(Path(name), frame).name == expected


def test_the_picture_goes_beside_the_file_or_here_where_that_is_read_only(tmp_path, monkeypatch):
    folder = tmp_path / "scenes"
    folder.mkdir()
    assert rendering.default_output(folder / "room.blend", "CYCLES") == folder / "room_cycles.png"
    folder.chmod(0o555)
    monkeypatch.chdir(tmp_path)
    assert rendering.default_output(folder / "room.blend", "CYCLES") == tmp_path / "room_cycles.png"
    folder.chmod(0o755)


def test_an_output_of_unknown_kind_is_refused(tmp_path):
    with pytest.raises(ToolError, match=r"\.png or \.exr"):
        rendering.check_output(tmp_path / "out.jpg")
