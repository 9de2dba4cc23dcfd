"""Motion-blur-aware RGB-D SLAM on a CPU.

* :class:`Tracker` follows a camera frame by frame: poses when the shutter opened and when it closed.
* :class:`Dataset` and :class:`Run` are recordings and results as numpy arrays, :class:`Map` renders views.
* :func:`track`, :func:`map`, :func:`slam` and the others are the commands of the ``mba`` program.

Camera frame: x right, y down, z forward. Poses are 4 x 4 matrices, camera-to-world. Metres, seconds, radians.
"""

from ._camera import Camera
from ._commands import (
    calibrate,
    command,
    evaluate_images,
    evaluate_mesh,
    evaluate_trajectory,
    export,
    import_recording,
    info,
    map,
    mesh,
    report,
    slam,
    synth,
    track,
)
from ._errors import ConfigError, DataWarning, Error, FrameError, InputError
from ._mba import Dataset, FrameResult, Map, Revision, RgbdFrame, Tracker, View, psnr, ssim
from ._run import Run

__all__ = [
    "Camera",
    "ConfigError",
    "DataWarning",
    "Dataset",
    "Error",
    "FrameError",
    "FrameResult",
    "InputError",
    "Map",
    "Revision",
    "RgbdFrame",
    "Run",
    "Tracker",
    "View",
    "calibrate",
    "command",
    "evaluate_images",
    "evaluate_mesh",
    "evaluate_trajectory",
    "export",
    "import_recording",
    "info",
    "map",
    "mesh",
    "psnr",
    "report",
    "slam",
    "ssim",
    "synth",
    "track",
]
