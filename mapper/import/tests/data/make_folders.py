"""Writes the folders and files of telephones and benchmarks of the tests.

    pip install Pillow numpy pyliblzfse
    python make_folders.py

Pixels follow from the formulas of make_bags.py. Poses: image k is at (k, 2, 3), turned by a quarter about z, so that x of
the camera is y of the world, in the axes of the format.
"""

import json
import shutil
import struct
import zipfile
import zlib
from pathlib import Path

import liblzfse
import numpy as np
from PIL import Image

from make_bags import COLOUR, DEPTH, colour, depth, encoded

HERE = Path(__file__).parent / "folders"
FRAMES = 2
HALF = 0.5**0.5


def pose(k):
    """Camera-to-world, x right, y down, z forward."""
    matrix = np.eye(4)
    matrix[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    matrix[:3, 3] = [k, 2, 3]
    return matrix


def opengl(k):
    """The same camera with y up and z backward."""
    return pose(k) @ np.diag([1.0, -1.0, -1.0, 1.0])


def text(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


def image(path, pixels, kind=None, **options):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, kind, **options)


def rows(matrix):
    return "".join(" ".join(repr(float(x)) for x in row) + "\n" for row in matrix)


def confidence(k, scale=1):
    """0, 1, 2, 0, 1, 2, ..., as ARKit has it."""
    y, x = np.mgrid[0 : DEPTH[1], 0 : DEPTH[0]]
    return ((x + y + k) % 3 * scale).astype(np.uint8)


def holes(k):
    """Depth with 65535 where there is none."""
    pixels = depth(k)
    pixels[0, :3] = 65535
    return pixels


def seven_scenes(folder):
    big = np.zeros((480, 640, 3), np.uint8)
    for k in range(FRAMES):
        big[:12, :16] = colour(k)
        image(folder / f"frame-{k:06}.color.png", big)
        far = np.full((480, 640), 65535, np.uint16)
        far[:6, :8] = depth(k)
        image(folder / f"frame-{k:06}.depth.png", far)
        matrix = pose(k)
        # Not quite a rotation, as theirs.
        matrix[0, 0] = 0.004
        text(folder / f"frame-{k:06}.pose.txt", rows(matrix))
    text(folder / "frame-000001.pose.txt", rows(np.full((4, 4), -np.inf)))


def bundle_fusion(folder):
    for k in range(FRAMES):
        image(folder / f"frame-{k:06}.color.jpg", colour(k), quality=95)
        image(folder / f"frame-{k:06}.depth.png", holes(k))
        text(folder / f"frame-{k:06}.pose.txt", rows(pose(k)))
    flat = lambda matrix: " ".join(repr(float(x)) for x in matrix.reshape(-1))
    intrinsic = lambda fx, fy, cx, cy: np.array([[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    text(
        folder / "info.txt",
        "m_versionNumber = 4\nm_sensorName = StructureSensor\n"
        f"m_colorWidth = {COLOUR[0]}\nm_colorHeight = {COLOUR[1]}\nm_depthWidth = {DEPTH[0]}\nm_depthHeight = {DEPTH[1]}\n"
        f"m_depthShift = 1000\nm_calibrationColorIntrinsic = {flat(intrinsic(14.5, 14.25, 7.5, 5.5))}\n"
        f"m_calibrationColorExtrinsic = {flat(np.eye(4))}\n"
        f"m_calibrationDepthIntrinsic = {flat(intrinsic(7.125, 7.25, 3.5, 2.5))}\n"
        f"m_calibrationDepthExtrinsic = {flat(np.eye(4))}\nm_frames.size = {FRAMES}\n",
    )


def open3d(folder):
    for k in range(FRAMES):
        image(folder / "color" / f"{k:06}.jpg", colour(k), quality=95)
        image(folder / "depth" / f"{k:06}.png", depth(k, COLOUR))
    camera = {"width": COLOUR[0], "height": COLOUR[1], "intrinsic_matrix": [14.5, 0, 0, 0, 14.25, 0, 7.5, 5.5, 1]}
    text(folder / "camera_intrinsic.json", json.dumps(camera))


def stray(folder):
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for k in range(FRAMES):
        image(folder / "rgb" / f"{k:06}.jpg", colour(k), quality=95)
        image(folder / "depth" / f"{k:06}.png", depth(k))
        image(folder / "confidence" / f"{k:06}.png", confidence(k))
        lines.append(f"{25961.116333375 + k / 64}, {k:06}, {k}, 2, 3, 0, 0, {HALF}, {HALF}")
    text(folder / "odometry.csv", "\n".join(lines) + "\n")
    text(folder / "camera_matrix.csv", "14.5, 0.0, 7.5\n0.0, 14.25, 5.5\n0.0, 0.0, 1.0\n")


def stray_video(folder):
    text(folder / "odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n1, 000000, 0, 0, 0, 0, 0, 0, 1\n")
    text(folder / "camera_matrix.csv", "14.5, 0.0, 7.5\n0.0, 14.25, 5.5\n0.0, 0.0, 1.0\n")
    text(folder / "rgb.mp4", "a video")


def polycam(folder):
    for k in range(FRAMES):
        name = str(59426112113 + 33333 * k)
        image(folder / "keyframes" / "images" / f"{name}.jpg", colour(k), quality=95)
        image(folder / "keyframes" / "depth" / f"{name}.png", depth(k))
        image(folder / "keyframes" / "confidence" / f"{name}.png", confidence(k, 127))
        values = {"fx": 14.5 + k, "fy": 14.25 + k, "cx": 7.5, "cy": 5.5, "width": COLOUR[0], "height": COLOUR[1]}
        values |= {f"t_{r}{c}": opengl(k)[r, c] for r in range(3) for c in range(4)}
        text(folder / "keyframes" / "cameras" / f"{name}.json", json.dumps(values | {"blur_score": 100.0}))


def scanner_app(folder):
    for k in range(FRAMES + 1):
        # Colour is not saved for every frame.
        if k < FRAMES:
            image(folder / f"frame_{k:05}.jpg", colour(k), quality=95)
        image(folder / f"depth_{k:05}.png", depth(k))
        image(folder / f"conf_{k:05}.png", confidence(k))
        values = {
            "cameraPoseARFrame": opengl(k).reshape(-1).tolist(),
            "intrinsics": [14.5, 0, 7.5, 0, 14.25, 5.5, 0, 0, 1],
            "time": 172.25 + k / 64,
            "exposureDuration": 0.008333333333333333,
            "motionQuality": 1,
        }
        text(folder / f"frame_{k:05}.json", json.dumps(values))


def transforms(folder):
    frames = []
    for k in range(FRAMES):
        image(folder / "images" / f"frame_{k:05}.png", colour(k))
        image(folder / "depth" / f"frame_{k:05}.png", depth(k, COLOUR))
        mask = np.full(COLOUR[::-1], 255, np.uint8)
        mask[3] = 0
        image(folder / "masks" / f"frame_{k:05}.png", mask)
        frames.append(
            {
                "file_path": f"images/frame_{k:05}.png",
                "depth_file_path": f"depth/frame_{k:05}.png",
                "mask_path": f"masks/frame_{k:05}.png",
                "transform_matrix": opengl(k).tolist(),
            }
        )
    scene = {"camera_model": "OPENCV", "w": COLOUR[0], "h": COLOUR[1], "fl_x": 14.5, "fl_y": 14.25, "cx": 8.0, "cy": 6.0}
    text(folder / "transforms.json", json.dumps(scene | {"k1": 0.01, "k2": 0.0, "p1": 0.0, "p2": 0.001, "frames": frames}))


def icl_nuim(folder):
    lines, truth = [], []
    big, far = np.zeros((480, 640, 3), np.uint8), np.zeros((480, 640), np.uint16)
    for k in range(FRAMES):
        big[:12, :16], far[:6, :8] = colour(k), depth(k)
        image(folder / "rgb" / f"{k}.png", big)
        image(folder / "depth" / f"{k}.png", far)
        lines.append(f"{k} depth/{k}.png {k} rgb/{k}.png")
        # World and camera with y up: a quarter about z the other way.
        truth.append(f"{k} {k} -2 3 0 0 {-HALF} {HALF}")
    text(folder / "associations.txt", "\n".join(lines) + "\n")
    text(folder / "livingRoom0.gt.freiburg", "\n".join(truth) + "\n")


def quaternion_of(r):
    """x, y, z, w of a rotation: the eigenvector of the largest eigenvalue (Bar-Itzhack 2000)."""
    vector = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = r + r.T - np.trace(r) * np.eye(3)
    matrix[:3, 3] = matrix[3, :3] = vector
    matrix[3, 3] = np.trace(r)
    return [float(v) for v in np.linalg.eigh(matrix)[1][:, -1]]


def mba_vo(folder):
    """The body has x ahead, y left, z up; depth is the distance along the ray."""
    from_camera = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    y, x = np.mgrid[0 : DEPTH[1], 0 : DEPTH[0]]
    focal, centre = (7.0, 7.25), (3.5, 2.5)
    stretch = np.sqrt(1 + ((x - centre[0]) / focal[0]) ** 2 + ((y - centre[1]) / focal[1]) ** 2)
    times, truth = [], ["# t qx qy qz qw x y z vx vy vz rx ry rz ax ay az"]
    for k in range(FRAMES):
        small = np.ascontiguousarray(colour(k)[: DEPTH[1], : DEPTH[0]])
        image(folder / "rgb_blur" / f"{k + 7:04}.png", small)
        image(folder / "rgb_sharp_middle" / f"{k + 7:04}.jpg", small, quality=95)
        distances = depth(k) / 1000 * stretch
        distances[0, 0] = 65504
        text(folder / "depth_sharp_middle" / f"{k + 7:04}.depth", rows(distances))
        times.append(f"{k * 0.0369 + 0.25} {k + 7:04}")
        body = pose(k) @ np.linalg.inv(from_camera)
        quaternion = quaternion_of(body[:3, :3])
        numbers = quaternion + [float(v) for v in body[:3, 3]] + [0.0] * 9
        truth.append(" ".join(map(repr, [k * 0.0369 + 0.25] + numbers)))
    text(folder / "im_list.txt", "\n".join(times) + "\n")
    text(folder / "groundtruth.txt", "\n".join(truth) + "\n")
    camera = {"W": DEPTH[0], "H": DEPTH[1], "fx": focal[0], "fy": focal[1], "cx": centre[0], "cy": centre[1]}
    axes = {f"extrinsic_Rb2w_q{axis}": q for axis, q in zip("wxyz", [0.5, -0.5, 0.5, -0.5])}
    settings = {"dataset_type": "unreal", "dt_frame": 0.0369, "exposure_time": 0.0156288, **camera, **axes}
    text(folder / "unreal.json", json.dumps({"Configuration": settings}, indent=1))


def sens(path):
    intrinsic = lambda fx, fy, cx, cy: np.array([[fx, 0, cx, 0], [0, fy, cy, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    name = b"StructureSensor"
    with open(path, "wb") as file:
        file.write(struct.pack("<IQ", 4, len(name)) + name)
        for matrix in [intrinsic(14.5, 14.25, 7.5, 5.5), np.eye(4), intrinsic(7.125, 7.25, 3.5, 2.5), np.eye(4)]:
            file.write(matrix.astype("<f4").tobytes())
        # JPEG, and depth deflated.
        file.write(struct.pack("<iiIIIIfQ", 2, 1, *COLOUR, *DEPTH, 1000.0, FRAMES))
        for k in range(FRAMES):
            jpeg = encoded(colour(k), "JPEG", quality=95).tobytes()
            packed = zlib.compress(depth(k).astype("<u2").tobytes())
            file.write(pose(k).astype("<f4").tobytes())
            file.write(struct.pack("<QQQQ", 5000123 + 33333 * k, 5000125 + 33333 * k, len(jpeg), len(packed)))
            file.write(jpeg + packed)
        file.write(struct.pack("<Q", 0))


def r3d(path):
    matrix = [14.5, 0, 0, 0, 14.25, 0, 7.5, 5.5, 1]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        metadata = {"w": COLOUR[0], "h": COLOUR[1], "dw": DEPTH[0], "dh": DEPTH[1], "fps": 60, "K": matrix}
        # Quaternion x y z w of the camera with y up, then its place.
        turned = [HALF, HALF, 0.0, 0.0]
        metadata["poses"] = [turned + [float(k), 2.0, 3.0] for k in range(FRAMES)]
        metadata["frameTimestamps"] = [1045.625 + k / 64 for k in range(FRAMES)]
        archive.writestr("metadata", json.dumps(metadata))
        for k in range(FRAMES):
            archive.writestr(f"rgbd/{k}.jpg", encoded(colour(k), "JPEG", quality=95).tobytes())
            metres = depth(k).astype("<f4") / 1000
            metres[0, 0] = np.nan
            archive.writestr(f"rgbd/{k}.depth", liblzfse.compress(metres.tobytes()))
            archive.writestr(f"rgbd/{k}.conf", liblzfse.compress(confidence(k).tobytes()))


if __name__ == "__main__":
    shutil.rmtree(HERE, ignore_errors=True)
    for make in [seven_scenes, bundle_fusion, open3d, stray, stray_video, polycam, scanner_app, transforms, icl_nuim, mba_vo]:
        make(HERE / make.__name__)
    sens(HERE / "scene.sens")
    r3d(HERE / "recording.r3d")
    print(sum(path.stat().st_size for path in HERE.rglob("*") if path.is_file()), "bytes")
