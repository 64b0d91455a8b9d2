# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a scene snapshot (.npz) with `addon.render` alone; runs without Blender.

Takes the same job and sends the same messages as `render_job`.
"""

import json
import signal
import sys
import time
from concurrent.futures import Future, wait
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

sys.path.append(str(Path(__file__).resolve().parent.parent))

from addon.output import write_channels
from addon.render import Device, DeviceError, Renderer, RenderError, ShaderError, gl_thread, stop_gl_thread
from addon.report.engines import FALSE, TRUE
from addon.report.messages import INTERRUPTED, JobError, send
from addon.scene import Channel, IndirectSettings, Moment, RenderSettings, Scene, Sequence, snapshot
from addon.scene.snapshot import Snapshot

T = TypeVar("T")
S = TypeVar("S", RenderSettings, IndirectSettings)

DEFAULT_RESOLUTION = (1920, 1080)
FIXED = {"width", "height", "channels", "deep_output"}


def settings_of(job: dict[str, Any]) -> RenderSettings:
    """The render settings of a job. Raises JobError naming what cannot be set."""
    width, height = job["resolution"] or DEFAULT_RESOLUTION
    settings = RenderSettings(width, height, samples=job["samples"] or RenderSettings(1, 1).samples)
    for name, text in job["set"]:
        settings = replaced(settings, name, name.split("."), text)
    return settings


def replaced(settings: S, name: str, path: list[str], text: str) -> S:
    """`settings`, a dataclass, with what `path`, spelled `name`, leads to as `text` says. Raises JobError."""
    known = {each.name: getattr(settings, each.name) for each in fields(settings) if each.name not in FIXED}
    first, rest = path[0], path[1:]
    if first not in known or is_dataclass(known[first]) != bool(rest):
        names = [f"{each}.…" if is_dataclass(value) else each for each, value in known.items()]
        raise JobError(f"A snapshot has no setting {name!r}; it has {', '.join(sorted(names))}.")
    if rest:
        return replace(settings, **{first: replaced(known[first], name, rest, text)})
    try:
        return replace(settings, **{first: parse(type(known[first]), text)})
    except ValueError as error:
        raise JobError(f"{name}: {error}") from error


def parse(kind: type, text: str) -> object:
    """The value of type `kind` (bool, int, float or a string enumeration) that `text` means. Raises ValueError."""
    if kind is bool:
        if text.lower() not in TRUE | FALSE:
            raise ValueError(f"true or false, not {text!r}")
        return text.lower() in TRUE
    if issubclass(kind, Enum):
        if text not in kind.__members__:
            raise ValueError(f"one of {', '.join(kind.__members__)}, not {text!r}")
        return kind[text]
    return kind(text)


def frames_of(loaded: Snapshot, file: str) -> tuple[Moment, Sequence]:
    """The frame to render and what the snapshot holds of those before it. Raises JobError where there is no camera."""
    frame = moment(loaded.scene)
    if frame is None:
        raise JobError(f"{file}: the scene has no camera.")
    return frame, Sequence(previous=moment(loaded.previous), earlier=moment(loaded.earlier))


def moment(scene: Scene | None) -> Moment | None:
    """A scene as its own camera sees it; None where there is nothing to see or nobody to see it."""
    return None if scene is None or scene.camera is None else Moment(scene, scene.camera)


def finished(future: "Future[T]") -> T:
    """The result of a job on the GL thread; a signal is handled while waiting."""
    while not future.done():
        wait([future], timeout=0.1)
    return future.result()


def render(frame: Moment, sequence: Sequence, settings: RenderSettings, time_limit: float) -> dict[str, Any]:
    """Render once; statistics with the key `picture`, (H, W, 4) float32, beside those of the engine."""
    started = time.perf_counter()
    samples: list[float] = []

    def elapsed() -> float:
        return time.perf_counter() - started

    def begin(device: Device) -> Renderer:
        renderer = Renderer(device)
        renderer.begin(frame.scene, frame.camera, settings, sequence)
        return renderer

    def sample(device: Device) -> int:
        done = renderer.render_sample()
        device.context.finish()
        return done

    renderer = finished(gl_thread().submit(begin))
    first_picture = 0.0
    while len(samples) < settings.samples and not (samples and time_limit and elapsed() >= time_limit):
        start = time.perf_counter()
        done = finished(gl_thread().submit(sample))
        samples.append(time.perf_counter() - start)
        first_picture = first_picture or elapsed()
        send("progress", f"Sample {done}/{settings.samples}")
    picture = finished(gl_thread().submit(lambda _device: renderer.read(Channel.COMBINED)))
    total = elapsed()
    measured = finished(gl_thread().submit(lambda _device: renderer.statistics()))
    finished(gl_thread().submit(lambda _device: renderer.release()))
    return {
        "picture": picture,
        "sync_s": None,
        "upload_s": measured.upload_s,
        "first_picture_s": first_picture,
        "sample_s": median(samples[1:] or samples),
        "total_s": total,
        "samples": len(samples),
        "passes": [{"name": name, "ms": milliseconds} for name, milliseconds in measured.passes],
        "left_out": [{"name": name, "reason": reason} for name, reason in measured.left_out],
        "triangles": measured.triangles,
        "draws": measured.draws,
        "instances": measured.instances,
        "bytes": measured.bytes,
        "warnings": list(measured.warnings),
        "files": [],
        "engine": "DEEP_GBUFFER",
        "device": measured.device,
        "blender": None,
    }


def run(job: dict[str, Any]) -> None:
    """Do the job. Raises JobError, OSError or the renderer's errors with a message for a person."""
    frame, sequence = frames_of(snapshot.load(job["file"]), job["file"])
    settings = settings_of(job)
    entries = [render(frame, sequence, settings, job["time_limit"] or 0.0) for _ in range(job["repeat"])]
    picture = [entry.pop("picture") for entry in entries][-1]
    path = Path(job["scratch"]) / "picture.exr"
    write_channels(path, {letter: picture[..., index] for index, letter in enumerate("RGBA")})
    send("picture", {"path": str(path), "frame": 0})
    send("statistics", entries)


def main() -> int:
    """Exit code of the job in `sys.argv`."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    job = json.loads(sys.argv[sys.argv.index("--") + 1])
    try:
        run(job)
    except (JobError, OSError, snapshot.SnapshotError, DeviceError, RenderError, ShaderError) as error:
        send("error", str(error))
        return 1
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        stop_gl_thread()
    return 0


if __name__ == "__main__":
    sys.exit(main())
