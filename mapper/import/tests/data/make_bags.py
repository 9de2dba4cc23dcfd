"""Writes the bags and MCAP files of the tests with programs of others.

    pip install mcap rosbags Pillow numpy
    python make_bags.py

Images follow from formulas, which the tests have, too: the colour of column x, row y of image k is
(10 x + k, 20 y, 200 - k), its depth 1000 + x + 8 y + 100 k raw units.
"""

import io
import json
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from PIL import Image
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

HERE = Path(__file__).parent
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
START = 1_700_000_000_123_456_789
INTERVAL = 33_333_333
FRAMES = 3
COLOUR, DEPTH = (16, 12), (8, 6)


def colour(k):
    y, x = np.mgrid[0 : COLOUR[1], 0 : COLOUR[0]]
    return np.stack([10 * x + k, 20 * y, np.full_like(x, 200 - k)], axis=-1).astype(np.uint8)


def depth(k, size=DEPTH):
    y, x = np.mgrid[0 : size[1], 0 : size[0]]
    return (1000 + x + 8 * y + 100 * k).astype(np.uint16)


def encoded(pixels, kind, **options):
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, **options)
    return np.frombuffer(file.getvalue(), np.uint8)


class Maker:
    """Messages of one version of ROS."""

    def __init__(self, store):
        self.store = store
        self.types = store.types
        self.is_one = store is ROS1

    def make(self, name, **fields):
        return self.types[name](**fields)

    def header(self, time, frame):
        stamp = self.make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        number = {"seq": 7} if self.is_one else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **number)

    def image(self, time, frame, pixels, encoding, padding=0, big_endian=False):
        rows = pixels.astype(pixels.dtype.newbyteorder(">" if big_endian else "<"))
        rows = np.frombuffer(rows.tobytes(), np.uint8).reshape(pixels.shape[0], -1)
        rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=99)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(time, frame),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(big_endian),
            step=rows.shape[1],
            data=rows.reshape(-1),
        )

    def compressed(self, time, frame, format, data):
        header = self.header(time, frame)
        return self.make("sensor_msgs/msg/CompressedImage", header=header, format=format, data=data)

    def camera(self, time, frame, size, intrinsics, distortion=(), model="plumb_bob"):
        fx, fy, cx, cy = intrinsics
        roi = self.make(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        upper = (lambda name: name.upper()) if self.is_one else (lambda name: name)
        matrices = {
            upper("d"): np.array(distortion, float),
            upper("k"): np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1], float),
            upper("r"): np.eye(3).reshape(-1),
            upper("p"): np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], float),
        }
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(time, frame),
            height=size[1],
            width=size[0],
            distortion_model=model,
            binning_x=0,
            binning_y=0,
            roi=roi,
            **matrices,
        )

    def vector(self, values):
        x, y, z = values
        return self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def quaternion(self, values):
        x, y, z, w = values
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def imu(self, time, frame, rate, force):
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(time, frame),
            orientation=self.quaternion([0.0, 0.0, 0.0, 1.0]),
            orientation_covariance=np.full(9, -1.0),
            angular_velocity=self.vector(rate),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(force),
            linear_acceleration_covariance=np.zeros(9),
        )

    def transform(self, translation, rotation):
        parts = {"translation": self.vector(translation), "rotation": self.quaternion(rotation)}
        return self.make("geometry_msgs/msg/Transform", **parts)

    def frames(self, time, frames):
        stamped = [
            self.make(
                "geometry_msgs/msg/TransformStamped",
                header=self.header(time, parent),
                child_frame_id=child,
                transform=self.transform(translation, rotation),
            )
            for parent, child, translation, rotation in frames
        ]
        return self.make("tf2_msgs/msg/TFMessage", transforms=stamped)


def recording(m, compressed=False):
    """Messages with their topics and times, of a camera with depth beside it and an IMU."""
    half = 0.5**0.5
    frames = [
        ("camera_link", "colour_optical", [0.015, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]),
        ("camera_link", "depth_optical", [-0.035, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]),
        ("camera_link", "imu_frame", [0.0, 0.01, 0.0], [0.0, 0.0, half, half]),
    ]
    yield "/tf_static", START - 5, m.frames(START - 5, frames)
    for k in range(FRAMES):
        time = START + k * INTERVAL
        # Recorded a little later than exposed.
        at = time + 2_000_000
        lens = [0.1, -0.05, 0.001, -0.002, 0.01]
        yield "/camera/color/camera_info", at, m.camera(time, "colour_optical", COLOUR, [14.5, 14.25, 7.5, 5.5], lens)
        yield "/camera/depth/camera_info", at, m.camera(time, "depth_optical", DEPTH, [7.125, 7.25, 3.5, 2.5])
        if not compressed:
            yield "/camera/color/image_raw", at, m.image(time, "colour_optical", colour(k), "rgb8", padding=5)
            yield "/camera/depth/image_rect_raw", at + 1, m.image(time + 11, "depth_optical", depth(k), "16UC1")
        else:
            jpeg = encoded(colour(k), "JPEG", quality=95)
            yield "/camera/color/image_raw/compressed", at, m.compressed(time, "colour_optical", "rgb8; jpeg compressed bgr8", jpeg)
            png = np.concatenate([np.arange(12, dtype=np.uint8), encoded(depth(k), "PNG")])
            name = "/camera/depth/image_rect_raw/compressedDepth"
            yield name, at + 1, m.compressed(time + 11, "depth_optical", "16UC1; compressedDepth png", png)
        for i in range(4):
            sample = time + i * 5_000_000
            yield "/camera/imu", sample, m.imu(sample, "imu_frame", [0.1 * i, k, -0.25], [0.5, -9.75, i])
    yield "/camera/notes", START, m.make("std_msgs/msg/String", data="not an image")


def write_mcap(name, messages, **options):
    with open(HERE / name, "wb") as file:
        writer = Writer(file, **options)
        writer.start()
        channels = {}
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in channels:
                text, _ = ROS2.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=text.encode())
                channels[topic] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            data = bytes(ROS2.serialize_cdr(message, kind))
            writer.add_message(channel_id=channels[topic], log_time=time, publish_time=time, data=data)
        writer.finish()


def write_bag(name, messages, compression=None):
    path = HERE / name
    path.unlink(missing_ok=True)
    writer = BagWriter(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(connections[topic], time, bytes(ROS1.serialize_ros1(message, kind)))


def realsense(m):
    """As RealSense Viewer records: depth as mono16, metadata as pairs, places of streams against that of depth."""
    prefix, sensors = "/device_0", {"Depth_0": 0, "Color_0": 1, "Gyro_0": 2, "Accel_0": 2}
    topic = {name: f"{prefix}/sensor_{number}/{name}" for name, number in sensors.items()}
    first = 1
    yield f"{topic['Depth_0']}/info/camera_info", first, m.camera(0, "", DEPTH, [7.0, 7.0, 3.5, 2.5], [0.0] * 5, "Brown Conrady")
    lens = [-0.055, 0.068, -0.0003, 0.0006, -0.021]
    yield f"{topic['Color_0']}/info/camera_info", first, m.camera(0, "", COLOUR, [14.5, 14.5, 7.5, 5.5], lens, "Inverse Brown Conrady")
    unit = m.make("std_msgs/msg/Float32", data=0.0001)
    yield f"{prefix}/sensor_0/option/Depth Units/value", first, unit
    half = 0.5**0.5
    places = {"Depth_0": [0.0, 0.0, 0.0], "Color_0": [0.015, 0.001, 0.0], "Gyro_0": [0.0, 0.0, 0.0]}
    for name, place in places.items():
        turn = [0.0, half, 0.0, half] if name == "Gyro_0" else [0.0, 0.0, 0.0, 1.0]
        yield f"{topic[name]}/tf/0", first, m.transform(place, turn)
    for k in range(FRAMES):
        time, at = START + k * INTERVAL, 1_000_000_000 + k * INTERVAL
        yield f"{topic['Depth_0']}/image/data", at, m.image(time + 9, "1", depth(k), "mono16")
        yield f"{topic['Color_0']}/image/data", at + 5, m.image(time, "1", colour(k)[..., ::-1], "bgr8")
        for key, value in [("timestamp_domain", "Global Time"), ("Actual Exposure", str(8333 + k)), ("Gain Level", "64")]:
            pair = m.make("diagnostic_msgs/msg/KeyValue", key=key, value=value)
            yield f"{topic['Color_0']}/image/metadata", at + 5, pair
        for i in range(2):
            sample = time + i * 2_500_000
            yield f"{topic['Gyro_0']}/imu/data", at + i, m.imu(sample, "1", [0.5, k, i], [0.0] * 3)
            yield f"{topic['Accel_0']}/imu/data", at + i, m.imu(sample + 7, "1", [0.0] * 3, [0.25, -9.5, k])


def others(m):
    """Forms of images that are not in the others: metres, grey, PNG, inverse depth, big-endian rows."""
    intrinsics = [7.0, 7.0, 3.5, 2.5]
    for k in range(FRAMES):
        time = START + k * INTERVAL
        metres = depth(k).astype(np.float32) / 1000
        metres[0, 0], metres[0, 1], metres[0, 2] = np.nan, 0.0, 20.0
        yield "/rgb/camera_info", time, m.camera(time, "rgb", DEPTH, intrinsics)
        yield "/rgb/image_raw", time, m.image(time, "rgb", colour(k)[:6, :8, 0], "mono8")
        yield "/rgb/image_png/compressed", time, m.compressed(time, "rgb", "png", encoded(colour(k)[:6, :8], "PNG"))
        yield "/metres/depth/image", time, m.image(time, "rgb", metres, "32FC1")
        yield "/swapped/depth/image", time, m.image(time, "rgb", depth(k), "16UC1", big_endian=True)
        # The depth of code c is 60000 / (c - 1).
        with np.errstate(divide="ignore"):
            codes = np.round(60000 / metres + 1)
        codes[~np.isfinite(codes)] = 0
        header = np.concatenate([np.int32([1]).view(np.uint8), np.float32([60000, 1]).view(np.uint8)])
        inverse = np.concatenate([header, encoded(codes.astype(np.uint16), "PNG")])
        yield "/inverse/depth/compressedDepth", time, m.compressed(time, "rgb", "32FC1; compressedDepth png", inverse)


if __name__ == "__main__":
    two, one = Maker(ROS2), Maker(ROS1)
    write_mcap("zstd.mcap", recording(two), compression=CompressionType.ZSTD)
    write_mcap("lz4.mcap", recording(two, compressed=True), compression=CompressionType.LZ4, chunk_size=2000)
    write_mcap("plain.mcap", others(two), use_chunking=False, use_summary_offsets=False, repeat_channels=False)
    write_bag("none.bag", recording(one))
    write_bag("bz2.bag", recording(one, compressed=True), BagWriter.CompressionFormat.BZ2)
    write_bag("lz4.bag", realsense(one), BagWriter.CompressionFormat.LZ4)
    for path in sorted(HERE.iterdir()):
        print(path.name, path.stat().st_size)
