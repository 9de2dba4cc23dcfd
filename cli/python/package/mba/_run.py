"""RUN folders."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _mba

StrPath: TypeAlias = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Run:
    """What tracking or mapping found, frame by frame, and the folder that holds it.

    Poses are camera-to-world, n x 4 x 4. ``poses`` are those in the middle of the exposure. Wherever a folder is asked for, a
    run may be given.
    """

    folder: Path
    #: ``summary.json``: settings, counts and figures.
    summary: dict[str, Any] = field(repr=False)
    #: Mid exposure, seconds.
    timestamps: NDArray[np.float64] = field(repr=False)
    poses: NDArray[np.float64] = field(repr=False)
    #: Poses when the shutter opened and closed.
    opening: NDArray[np.float64] = field(repr=False)
    closing: NDArray[np.float64] = field(repr=False)
    #: ``"ok"``, ``"weak"`` or ``"lost"``.
    status: list[str] = field(repr=False)
    is_keyframe: NDArray[np.bool_] = field(repr=False)
    #: Length of the blur in pixels; NaN where it is not known.
    blur_px: NDArray[np.float64] = field(repr=False)
    #: Time that tracking the frame took; NaN where it was not tried.
    milliseconds: NDArray[np.float64] = field(repr=False)
    #: Standard deviation of the position relative to the first frame, metres; NaN where it is not known.
    sigma_m: NDArray[np.float64] = field(repr=False)

    @classmethod
    def open(cls, folder: StrPath) -> Run:
        """Reads a RUN folder of any command."""
        held = _mba.read_run(os.fspath(folder))
        return cls(folder=Path(folder), summary=json.loads(held.pop("summary")), **held)

    def __len__(self) -> int:
        return len(self.timestamps)

    def __fspath__(self) -> str:
        return os.fspath(self.folder)

    @property
    def is_tracked(self) -> NDArray[np.bool_]:
        """Whether each frame has a pose: it is not lost."""
        return np.array([status != "lost" for status in self.status], dtype=bool)

    @property
    def deblurred(self) -> dict[int, Path]:
        """The images of the deblurred keyframes, by the index of the frame."""
        return {int(path.stem): path for path in sorted((self.folder / "deblurred").glob("*.png"))}

    @property
    def map(self) -> _mba.Map:
        """The map of a run that has one."""
        return _mba.Map.load(self.folder)

    @property
    def dataset(self) -> _mba.Dataset:
        """The data set of the run, if it still lies where it was."""
        return _mba.Dataset(self.summary["dataset"])
