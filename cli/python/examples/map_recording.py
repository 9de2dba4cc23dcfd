"""Tracks and maps a recording, and renders the view of its most blurred keyframe.

    python map_recording.py [DATASET]
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import mba


def main(folder: str | None) -> None:
    with tempfile.TemporaryDirectory() as place:
        out = Path(place)
        data = mba.Dataset(folder) if folder else mba.synth(out / "data", frames=12, size=(160, 120), blur=3)
        run = mba.track(data, out / "run")
        mapped = mba.map(data, run, out / "mapped", progress=lambda share, what: print(f"{share:4.0%} {what}"))
        blurred = int(np.argmax(np.where(run.is_keyframe, run.blur_px, -1.0)))
        view = mapped.map.render(mapped.poses[blurred])
        print(f"{len(mapped.map)} Gaussians; frame {blurred} had {run.blur_px[blurred]:.1f} px of blur")
        print(f"its view: {view.rgb.shape}, {view.solid:.0%} of it solid, depth {np.median(view.depth):.2f} m")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
