"""The compiled part of the package."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, SupportsIndex, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._camera import Camera

__all__ = [
    "Dataset",
    "FrameResult",
    "Map",
    "Revision",
    "RgbdFrame",
    "Tracker",
    "View",
    "call",
    "main",
    "psnr",
    "read_run",
    "ssim",
]

@final
class Tracker:
    """Follows a camera frame by frame.

    Give it undistorted images with the depth registered to the colour image. The world is the camera of the first frame at
    mid exposure. Every frame takes about the same time and no memory besides what the tracker took when it was made.
    """

    def __new__(
        cls,
        camera: Camera,
        *,
        blur: bool = True,
        virtual_views: int | None = None,
        reference: Literal["deblurred", "raw"] = "deblurred",
        depth_term: bool = True,
        readout: float = 0.0,
        depth_readout: float = 0.0,
        depth_apart: bool = False,
        vignetting: tuple[float, float] = ...,
    ) -> Tracker:
        """A tracker for images of ``camera``.

        blur: model the motion during the exposure, or take every frame for sharp.
        virtual_views: sharp views along an exposure, at the most.
        reference: keyframes as captured, or deblurred with their own motion.
        depth_term: use the depth of every frame, not only that of keyframes.
        readout, depth_readout: seconds from the first row to the last, 0 for a global shutter.
        depth_apart: depth images have times of their own.
        vignetting: coefficients a2 and a4 of the fall-off of light; none by default.

        Raises ConfigError for settings that no tracker has.
        """

    @property
    def camera(self) -> Camera: ...
    def track(
        self,
        rgb: NDArray[np.uint8],
        depth: NDArray[np.uint16] | NDArray[np.float32] | NDArray[np.float64],
        timestamp: float,
        *,
        exposure: float,
        depth_timestamp: float | None = None,
        angular_velocity: tuple[float, float, float] | None = None,
        angular_acceleration: tuple[float, float, float] | None = None,
        turned_by: tuple[float, float, float] | None = None,
    ) -> FrameResult:
        """Finds where the camera was while the shutter was open.

        rgb: bytes, (height, width, 3), or (height, width) for grey; as the camera stores them, not linear.
        depth: z along the optical axis, (height, width): raw units as uint16, or metres; 0 where it is missing.
        timestamp: the middle of the exposure, seconds; later than that of the frame before.
        exposure: the time that the shutter was open, seconds.
        depth_timestamp: when depth was measured, if the tracker was made for that.
        angular_velocity, angular_acceleration: what a gyroscope says around mid exposure, rad/s and rad/s^2 in the camera.
        turned_by: its mean angular velocity since the frame before, rad/s.

        Arrays whose rows follow each other are not copied. Raises FrameError for a frame that cannot be used.
        """

    def set_reference(
        self,
        rgb: NDArray[np.uint8],
        depth: NDArray[np.uint16] | NDArray[np.float32] | NDArray[np.float64],
        world_from_camera: ArrayLike,
    ) -> None:
        """Offers a sharp view from outside, of a map for instance; the next frames are aligned with it if that is better."""

    def reset(self) -> None:
        """Forgets everything: what follows is that of a new tracker."""

@final
class FrameResult:
    """What is known about a frame after tracking."""

    @property
    def index(self) -> int:
        """Running number of the frame, from 0."""
    @property
    def timestamp(self) -> float: ...
    @property
    def status(self) -> Literal["ok", "weak", "lost"]: ...
    @property
    def doubt(self) -> str | None:
        """Why the frame is weak or lost."""
    @property
    def opening(self) -> NDArray[np.float64]:
        """Camera-to-world, 4 x 4, when the shutter opened."""
    @property
    def middle(self) -> NDArray[np.float64]:
        """At mid exposure."""
    @property
    def closing(self) -> NDArray[np.float64]:
        """When the shutter closed."""
    @property
    def blur_px(self) -> float:
        """Mean length of the blur, pixels."""
    @property
    def virtual_views(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def residual(self) -> float:
        """Robust photometric residual, standard deviations of the nominal noise."""
    @property
    def inliers(self) -> float:
        """Share of the patches of the keyframe that are in view and agree."""
    @property
    def disagreement(self) -> float:
        """How far picture and depth are apart; 1 for noise alone."""
    @property
    def gain(self) -> float:
        """Factor on the light of the keyframe."""
    @property
    def offset(self) -> float: ...
    @property
    def information(self) -> NDArray[np.float64]:
        """Inverse covariance, 14 x 14: motion of the middle (translation in the axes of the keyframe, rotation in the camera),
        motion from opening to closing, gain, offset."""
    @property
    def is_keyframe(self) -> bool: ...
    @property
    def reference_index(self) -> int:
        """The frame that this one was aligned with."""
    @property
    def revision(self) -> Revision | None:
        """A better estimate of an earlier frame, which this one taught."""

@final
class Revision:
    """A better estimate of an earlier frame."""

    @property
    def index(self) -> int: ...
    @property
    def opening(self) -> NDArray[np.float64]: ...
    @property
    def middle(self) -> NDArray[np.float64]: ...
    @property
    def closing(self) -> NDArray[np.float64]: ...
    @property
    def blur_px(self) -> float: ...

@final
class Dataset:
    """A recorded RGB-D sequence, frame by frame: ``for frame in dataset`` and ``dataset[k]`` read the images."""

    def __new__(cls, folder: str | os.PathLike[str]) -> Dataset:
        """Reads lists, calibration and truth, but no image yet. Raises InputError."""
    def __len__(self) -> int: ...
    def __getitem__(self, index: SupportsIndex, /) -> RgbdFrame: ...
    def __fspath__(self) -> str: ...
    @property
    def folder(self) -> Path: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def frame_rate(self) -> float: ...
    @property
    def timestamps(self) -> NDArray[np.float64]: ...
    @property
    def exposure_seconds(self) -> NDArray[np.float64]: ...
    @property
    def ground_truth(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Times and camera-to-world poses, n and n x 4 x 4, if they are on record."""
    @property
    def ground_truth_exposures(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """Times, and poses at opening, middle and closing of the shutter."""
    @property
    def warnings(self) -> list[str]:
        """What is odd about it."""

@final
class RgbdFrame:
    """One frame, undistorted."""

    @property
    def index(self) -> int: ...
    @property
    def timestamp(self) -> float:
        """Mid exposure, seconds."""
    @property
    def depth_timestamp(self) -> float: ...
    @property
    def exposure_seconds(self) -> float: ...
    @property
    def rgb(self) -> NDArray[np.uint8]:
        """(height, width, 3), as the camera stores it."""
    @property
    def depth(self) -> NDArray[np.uint16]:
        """(height, width), raw units; 0 where it is missing."""

@final
class Map:
    """The map of a run."""

    @staticmethod
    def load(run: str | os.PathLike[str]) -> Map:
        """Reads the map of a RUN folder. Raises InputError where there is none."""
    @property
    def kind(self) -> Literal["gaussians", "triplane"]: ...
    @property
    def camera(self) -> Camera | None:
        """The camera of the run."""
    def __len__(self) -> int:
        """Number of Gaussians; 0 for a field."""
    def render(self, world_from_camera: ArrayLike, camera: Camera | None = None, *, fill: bool = True) -> View:
        """The view from a pose, 4 x 4, of the camera of the run or of another one.

        fill: take colours from the surroundings where the map has nothing.
        """
    def gaussians(self) -> dict[str, NDArray[np.float32]]:
        """``means`` (n, 3) metres, ``scales`` (n, 3) metres, ``quaternions_wxyz`` (n, 4), ``opacities`` (n,) and
        ``linear_rgb`` (n, 3)."""

@final
class View:
    """A rendered view."""

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """(height, width, 3), as the camera would store it."""
    @property
    def depth(self) -> NDArray[np.float32]:
        """(height, width), metres; 0 where the map is not solid."""
    @property
    def solid(self) -> float:
        """Share of the pixels that show the map."""

def psnr(reference: NDArray[np.uint8], estimate: NDArray[np.uint8]) -> float:
    """Peak signal-to-noise ratio of two images, dB; infinite for equal ones."""

def ssim(reference: NDArray[np.uint8], estimate: NDArray[np.uint8]) -> float:
    """Structural similarity of two colour images, as scikit-image computes it with Gaussian weights."""

def read_run(folder: str | os.PathLike[str]) -> dict[str, Any]: ...
def call(
    arguments: Sequence[str],
    progress: Callable[[float, str], None] | None = None,
    itself: Sequence[str] | None = None,
) -> tuple[str | None, list[str], list[str]]: ...
def main(arguments: Sequence[str], itself: Sequence[str]) -> int: ...
