"""The commands of the program as functions.

Options have the names and meanings that ``mba COMMAND --help`` prints; those that are None are left to the program. Each
function runs at the program's own speed with Python's lock released, warns of what is odd about the input
(:class:`mba.DataWarning`), and stops on Ctrl-C.
"""

from __future__ import annotations

import json
import logging
import os
import sys
import warnings
from pathlib import Path
from typing import Any, Callable, Literal, Mapping, TypeAlias

from . import _mba
from ._errors import DataWarning
from ._run import Run

Folder: TypeAlias = str | os.PathLike[str]
Progress = Callable[[float, str], None]

#: What starts the program again; ``mba map JOB --jobs`` does.
ITSELF = [sys.executable, "-m", "mba"]

_log = logging.getLogger("mba")


def command(
    *words: str | os.PathLike[str],
    progress: Progress | None = None,
    **options: Any,
) -> Any:
    """Runs ``mba WORDS... --OPTION VALUE ...`` and returns what it prints with ``--json``.

    True stands for an option without a value, None and False for none. ``progress`` is called with the share that is done
    (0 to 1) and what is being done, some times a second.
    """
    arguments = ["mba", *map_words(words), *option_words(options)]
    result, odd, notes = _mba.call(arguments, progress, ITSELF)
    for note in notes:
        _log.info(note)
    for warning in odd:
        warnings.warn(warning, DataWarning, stacklevel=3)
    return None if result is None else json.loads(result)


def figures(*words: str | os.PathLike[str], **options: Any) -> dict[str, Any]:
    """The same of a command that always has something to say."""
    found: dict[str, Any] = command(*words, **options)
    return found


def map_words(words: tuple[Any, ...]) -> list[str]:
    """Words of a command line."""
    return [os.fspath(word) for word in words]


def option_words(options: Mapping[str, Any]) -> list[str]:
    """Options of a command line."""
    words: list[str] = []
    for name, value in options.items():
        flag = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        # A value that begins with a dash is no option of its own.
        words.append(flag if value is True else f"{flag}={value_word(value)}")
    return words


def value_word(value: Any) -> str:
    """A value of a command line."""
    return os.fspath(value) if isinstance(value, (str, os.PathLike)) else repr(value)


def switch(value: bool | None) -> str | None:
    """The value of an option that is on or off."""
    return None if value is None else ("on" if value else "off")


def blur_mode(value: bool | None) -> str | None:
    """The value of ``--blur``."""
    return None if value is None else ("auto" if value else "off")


def synth(
    out: Folder,
    *,
    frames: int | None = None,
    size: tuple[int, int] | None = None,
    blur: float | None = None,
    scene: str | None = None,
    path: Literal["shake", "loop", "walk"] | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> _mba.Dataset:
    """Films a synthetic sequence with exact truth and returns the data set. ``size`` is (width, height)."""
    shape = None if size is None else f"{size[0]}x{size[1]}"
    known = dict(frames=frames, size=shape, blur=blur, scene=scene, path=path, seed=seed)
    command("synth", out=out, progress=progress, **known, **options)
    return _mba.Dataset(out)


def import_recording(
    source: Folder, out: Folder, *, progress: Progress | None = None, **options: Any
) -> _mba.Dataset:
    """Writes a recording of another program or camera as a data set, and returns it."""
    command("import", source, out=out, progress=progress, **options)
    return _mba.Dataset(out)


def info(dataset: Folder) -> dict[str, Any]:
    """What a data set holds and lacks, and what is odd about it."""
    return figures("info", dataset)


def calibrate(dataset: Folder, *, out: Folder | None = None, **options: Any) -> dict[str, Any]:
    """Finds what is not on record about the camera."""
    return figures("calibrate", dataset, out=out, **options)


def track(
    dataset: Folder,
    out: Folder,
    *,
    blur: bool | None = None,
    virtual_views: int | None = None,
    reference: Literal["raw", "deblurred"] | None = None,
    depth_term: bool | None = None,
    hindsight: bool | None = None,
    keyframes: bool | None = None,
    self_calibrate: bool | None = None,
    up: str | None = None,
    resume: bool = False,
    force: bool = False,
    checkpoint_interval: float | None = None,
    threads: int | None = None,
    simd: str | None = None,
    progress: Progress | None = None,
) -> Run:
    """Tracks a data set into the RUN folder ``out``.

    With ``hindsight`` a blurred recording is tracked once more from its end, which takes as long again; without, the poses are
    those that a :class:`mba.Tracker` finds frame by frame.
    Ctrl-C saves a checkpoint and raises KeyboardInterrupt; the same call with ``resume=True`` goes on.
    """
    command(
        "track",
        dataset,
        out=out,
        blur=blur_mode(blur),
        virtual_views=virtual_views,
        reference=reference,
        depth_term=switch(depth_term),
        hindsight=switch(hindsight),
        keyframes=switch(keyframes),
        self_calibrate=switch(self_calibrate),
        up=up,
        resume=resume,
        force=force,
        checkpoint_interval=checkpoint_interval,
        threads=threads,
        simd=simd,
        progress=progress,
    )
    return Run.open(out)


def map(  # noqa: A001 -- the command's name; it is called as mba.map
    dataset: Folder,
    trajectory: Folder,
    out: Folder,
    *,
    field: Literal["gaussians", "triplane"] | None = None,
    blur: bool | None = None,
    time_budget: float | None = None,
    virtual_views: int | None = None,
    max_keyframes: int | None = None,
    max_gaussians: int | None = None,
    seed: int | None = None,
    continuity: bool = True,
    resume: bool = False,
    force: bool = False,
    checkpoint_interval: float | None = None,
    threads: int | None = None,
    simd: str | None = None,
    progress: Progress | None = None,
) -> Run:
    """Makes a sharp map of a data set that was tracked into the run ``trajectory``, in the RUN folder ``out``.

    Ctrl-C saves a checkpoint and raises KeyboardInterrupt; the same call with ``resume=True`` goes on.
    """
    command(
        "map",
        dataset,
        trajectory=trajectory,
        out=out,
        field=field,
        blur=blur_mode(blur),
        time_budget=time_budget,
        virtual_views=virtual_views,
        max_keyframes=max_keyframes,
        max_gaussians=max_gaussians,
        seed=seed,
        no_continuity=not continuity,
        resume=resume,
        force=force,
        checkpoint_interval=checkpoint_interval,
        threads=threads,
        simd=simd,
        progress=progress,
    )
    return Run.open(out)


def slam(
    dataset: Folder,
    out: Folder,
    *,
    realtime: bool = False,
    time_budget: float | None = None,
    max_keyframes: int | None = None,
    max_gaussians: int | None = None,
    resume: bool = False,
    force: bool = False,
    checkpoint_interval: float | None = None,
    threads: int | None = None,
    simd: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Run:
    """Tracks and maps at the same time into the RUN folder ``out``; ``options`` are those of ``mba slam --help``."""
    command(
        "slam",
        dataset,
        out=out,
        realtime=realtime,
        time_budget=time_budget,
        max_keyframes=max_keyframes,
        max_gaussians=max_gaussians,
        resume=resume,
        force=force,
        checkpoint_interval=checkpoint_interval,
        threads=threads,
        simd=simd,
        progress=progress,
        **options,
    )
    return Run.open(out)


def mesh(run: Folder, out: Folder, *, progress: Progress | None = None, **options: Any) -> Path:
    """Writes the surface of a map as .ply, .glb or .obj and returns its path."""
    command("mesh", run, out=out, progress=progress, **options)
    return Path(out)


def export(
    run: Folder,
    to: Literal["nerfstudio", "colmap", "kitti", "euroc", "tum", "splat"],
    out: Folder,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Path:
    """Writes a run in the format of another program and returns its path."""
    command("export", run, to=to, out=out, progress=progress, **options)
    return Path(out)


def report(run: Folder, **options: Any) -> Path:
    """Writes ``report.html`` into a RUN folder and returns its path."""
    command("report", run, **options)
    return Path(run) / "report.html"


def evaluate_trajectory(reference: Folder, estimate: Folder | Run, **options: Any) -> dict[str, Any]:
    """Errors of a trajectory file, or of a run, against another: ATE, RPE and drift, as evo defines them."""
    file = estimate.folder / "trajectory.txt" if isinstance(estimate, Run) else estimate
    return figures("eval", "trajectory", reference=reference, estimate=file, **options)


def evaluate_images(reference: Folder, estimate: Folder, **options: Any) -> dict[str, Any]:
    """PSNR and SSIM of the images of a folder against those of the same name in another."""
    return figures("eval", "images", reference=reference, estimate=estimate, **options)


def evaluate_mesh(reference: Folder, estimate: Folder, **options: Any) -> dict[str, Any]:
    """Precision, recall and F1 of a surface against a true one."""
    return figures("eval", "mesh", reference=reference, estimate=estimate, **options)
