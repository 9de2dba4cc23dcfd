"""Shows a run in Rerun (pip install rerun-sdk): the path, every exposure as an arc, keyframes, and the map as points.

    python rerun_log.py RUN [FILE.rrd]
"""

import sys

import numpy as np

import mba

try:
    import rerun as rr
except ImportError:
    print("skipped: there is no rerun here (pip install rerun-sdk)")
    sys.exit()


def main(folder: str, file: str | None) -> None:
    run = mba.Run.open(folder)
    rr.init("mba", spawn=file is None)
    if file:
        rr.save(file)
    # The world is that of the first camera, y down, unless it is known where up is.
    axes = rr.ViewCoordinates.RIGHT_HAND_Z_UP if "upright" in run.summary else rr.ViewCoordinates.RIGHT_HAND_Y_DOWN
    rr.log("world", axes, static=True)
    tracked = run.is_tracked
    rr.log("world/path", rr.LineStrips3D([run.poses[tracked, :3, 3]]), static=True)
    arcs = np.stack([run.opening, run.poses, run.closing], axis=1)[tracked, :, :3, 3]
    rr.log("world/exposures", rr.LineStrips3D(list(arcs), colors=[[255, 120, 0]]), static=True)
    camera = run.summary["camera"]
    for index, image in run.deblurred.items():
        rr.set_time("time", duration=float(run.timestamps[index] - run.timestamps[0]))
        pose = run.poses[index]
        rr.log("world/camera", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        focal, centre = [camera["fx"], camera["fy"]], [camera["cx"] + 0.5, camera["cy"] + 0.5]
        size = [camera["width"], camera["height"]]
        rr.log("world/camera", rr.Pinhole(focal_length=focal, principal_point=centre, resolution=size))
        rr.log("world/camera/image", rr.EncodedImage(path=image))
    if (run.folder / "map.ply").is_file():
        held = run.map.gaussians()
        # Viewers show display values, the map holds light.
        colours = np.clip(held["linear_rgb"], 0.0, 1.0) ** (1 / 2.2)
        rr.log("world/map", rr.Points3D(held["means"], colors=colours, radii=held["scales"].max(axis=1)), static=True)
    print(f"{len(run)} frames, {len(run.deblurred)} keyframes logged")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python rerun_log.py RUN [FILE.rrd]")
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None)
