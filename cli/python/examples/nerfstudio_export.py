"""A run as a scene for nerfstudio, or any other trainer that reads transforms.json: deblurred keyframes, poses, depth, points.

    python nerfstudio_export.py [RUN] [OUT]
"""

import json
import sys
import tempfile
from pathlib import Path

import mba


def main(run_folder: str | None, out: str | None) -> None:
    with tempfile.TemporaryDirectory() as place:
        if run_folder:
            run = mba.Run.open(run_folder)
        else:
            data = mba.synth(Path(place) / "data", frames=12, size=(160, 120), blur=3)
            run = mba.track(data, Path(place) / "run")
        scene = mba.export(run, "nerfstudio", out or Path(place) / "scene")
        transforms = json.loads((scene / "transforms.json").read_text())
        print(f"{len(transforms['frames'])} images of {transforms['w']} x {transforms['h']} pixels in {scene}")
        print("train with: ns-train splatfacto --data", scene)


if __name__ == "__main__":
    main(*(sys.argv[1:] + [None, None])[:2])
