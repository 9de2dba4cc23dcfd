"""Writes the seeds of the fuzz target `recording`: one frame each, as small as it gets.

    pip install mcap rosbags Pillow numpy pyliblzfse
    python make_seeds.py
"""

from pathlib import Path

import make_bags
import make_folders
from make_bags import ROS1, ROS2, BagWriter, CompressionType, Maker, Writer, others, realsense, recording

SEEDS = Path(__file__).parents[4] / "tests" / "fuzz" / "seeds" / "recording"


def first(messages, wanted):
    """One message of each of these topics."""
    seen = set()
    for topic, time, message in messages:
        if topic in wanted and topic not in seen:
            seen.add(topic)
            yield topic, time, message


def write_mcap(name, messages, **options):
    """As make_bags has it, without the texts of definitions and without checksums."""
    with open(SEEDS / name, "wb") as file:
        writer = Writer(file, enable_crcs=False, **options)
        writer.start()
        channels = {}
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in channels:
                schema = writer.register_schema(name=kind, encoding="ros2msg", data=b"")
                channels[topic] = writer.register_channel(topic=topic, message_encoding="cdr", schema_id=schema)
            data = bytes(ROS2.serialize_cdr(message, kind))
            writer.add_message(channel_id=channels[topic], log_time=time, publish_time=time, data=data)
        writer.finish()


if __name__ == "__main__":
    SEEDS.mkdir(parents=True, exist_ok=True)
    camera = {f"/camera/{name}/camera_info" for name in ["color", "depth"]} | {"/tf_static", "/camera/imu"}
    images = {"/camera/color/image_raw", "/camera/depth/image_rect_raw"}
    packed = {"/camera/color/image_raw/compressed", "/camera/depth/image_rect_raw/compressedDepth"}
    two = Maker(ROS2)
    write_mcap("zstd_mcap", first(recording(two), camera | images), compression=CompressionType.ZSTD)
    write_mcap("plain_mcap", first(recording(two, True), camera | packed), use_chunking=False)
    wanted = {"/rgb/camera_info", "/rgb/image_raw", "/inverse/depth/compressedDepth"}
    write_mcap("lz4_mcap", first(others(two), wanted), compression=CompressionType.LZ4)
    make_bags.HERE = SEEDS
    topics = [f"/device_0/sensor_1/Color_0/{end}" for end in ["info/camera_info", "image/data", "image/metadata", "tf/0"]]
    topics += [f"/device_0/sensor_0/Depth_0/{end}" for end in ["info/camera_info", "image/data", "tf/0"]]
    make_bags.write_bag("none_bag", first(realsense(Maker(ROS1)), topics[:2] + topics[4:6]))
    make_bags.write_bag("bz2_bag", first(realsense(Maker(ROS1)), topics), BagWriter.CompressionFormat.BZ2)
    make_folders.FRAMES = 1
    make_folders.sens(SEEDS / "sens")
    make_folders.r3d(SEEDS / "r3d")
    for path in sorted(SEEDS.iterdir()):
        print(path.name, path.stat().st_size)
