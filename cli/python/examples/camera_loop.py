"""An own camera loop: frames come one by one, poses go out. A data set stands in for the camera.

    python camera_loop.py [DATASET]
"""

import sys
import tempfile
from pathlib import Path

import mba


def main(folder: str | None) -> None:
    with tempfile.TemporaryDirectory() as place:
        data = mba.Dataset(folder) if folder else mba.synth(Path(place) / "data", frames=20, size=(320, 240), blur=6)
        tracker = mba.Tracker(data.camera)
        for frame in data:
            result = tracker.track(frame.rgb, frame.depth, frame.timestamp, exposure=frame.exposure_seconds)
            moved = result.closing[:3, 3] - result.opening[:3, 3]
            print(
                f"{result.index:4d} {result.status:4s} blur {result.blur_px:5.1f} px, at {result.middle[:3, 3].round(4)} m, "
                f"{1e3 * (moved @ moved) ** 0.5:.1f} mm while the shutter was open"
            )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
