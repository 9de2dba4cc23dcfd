"""Data sets, runs, maps and figures as arrays."""

import json

import numpy as np
import pytest

import mba


def test_a_data_set_reads_what_was_written(data):
    assert len(data) == 12 and [frame.index for frame in data] == list(range(12))
    frame = data[-1]
    assert frame.rgb.shape == (120, 160, 3) and frame.rgb.dtype == np.uint8
    assert frame.depth.shape == (120, 160) and frame.depth.dtype == np.uint16
    assert frame.timestamp == data.timestamps[-1] and frame.exposure_seconds == data.exposure_seconds[-1]
    times, poses = data.ground_truth
    assert times.shape == (12,) and poses.shape == (12, 4, 4)
    np.testing.assert_allclose(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.tile(np.eye(3), (12, 1, 1)), atol=1e-9)
    with pytest.raises(IndexError, match="frame 12 of 12"):
        data[12]


def test_images_are_those_of_the_files(data):
    image = pytest.importorskip("PIL.Image")
    name = (data.folder / "rgb.txt").read_text().splitlines()[-1].split()[1]
    np.testing.assert_array_equal(data[-1].rgb, np.asarray(image.open(data.folder / name)))
    name = (data.folder / "depth.txt").read_text().splitlines()[-1].split()[1]
    np.testing.assert_array_equal(data[-1].depth, np.asarray(image.open(data.folder / name)))


def test_a_run_is_what_its_files_say(run):
    lines = [line for line in (run.folder / "trajectory.txt").read_text().splitlines() if not line.startswith("#")]
    values = np.array([[float(word) for word in line.split()] for line in lines])
    np.testing.assert_allclose(run.timestamps, values[:, 0])
    np.testing.assert_allclose(run.poses[:, :3, 3], values[:, 1:4], atol=1e-9)
    x, y, z, w = values[:, 4:].T
    # The third axis of the camera, by the quaternion.
    axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    np.testing.assert_allclose(run.poses[:, :3, 2], axis, atol=1e-8)
    assert run.summary == json.loads((run.folder / "summary.json").read_text())
    assert set(run.deblurred) == set(np.flatnonzero(run.is_keyframe))
    assert run.is_tracked.all() and run.blur_px[1:].mean() > 1.0 and (run.milliseconds > 0).all()
    assert len(run.dataset) == len(run)


def test_the_map_shows_what_the_sharp_images_show(data, mapped):
    image = pytest.importorskip("PIL.Image")
    index = int(np.flatnonzero(mapped.is_keyframe)[1])
    sharp = np.asarray(image.open(data.folder / "sharp" / f"{index:06d}.png"))
    view = mapped.map.render(mapped.poses[index])
    assert view.rgb.shape == sharp.shape and view.solid > 0.9
    captured, rendered = mba.psnr(sharp, data[index].rgb), mba.psnr(sharp, view.rgb)
    assert rendered > captured + 1.0 and rendered > 24.0
    assert mba.ssim(sharp, view.rgb) > mba.ssim(sharp, data[index].rgb)
    truth = data[index].depth / data.camera.depth_scale
    both = (truth > 0) & (view.depth > 0)
    assert np.median(np.abs(view.depth - truth)[both]) < 0.02


def test_views_of_other_cameras_and_sizes(mapped):
    pose = mapped.poses[3]
    camera = mapped.map.camera.resized(80, 60)
    small, large = mapped.map.render(pose, camera), mapped.map.render(pose.tolist())
    assert small.rgb.shape == (60, 80, 3)
    # The same picture: where it is coarse, a pixel is the mean of four.
    coarse = large.rgb.reshape(60, 2, 80, 2, 3).mean(axis=(1, 3)).round().astype(np.uint8)
    assert mba.psnr(coarse, small.rgb) > 20.0 > mba.psnr(coarse[:, ::-1], small.rgb)
    np.testing.assert_array_equal(mapped.map.render(pose).rgb, large.rgb)


def test_gaussians_are_those_of_the_map(mapped):
    held = mapped.map.gaussians()
    count = len(mapped.map)
    assert count == mapped.summary["map"]["gaussians"] > 1000
    shapes = {name: values.shape for name, values in held.items()}
    assert shapes == {
        "means": (count, 3),
        "scales": (count, 3),
        "quaternions_wxyz": (count, 4),
        "opacities": (count,),
        "linear_rgb": (count, 3),
    }
    assert (held["scales"] > 0).all() and (held["opacities"] >= 0).all() and (held["opacities"] <= 1).all()
    # Most of them are where the depth of the frames puts surfaces.
    lower, upper = np.percentile(held["means"], [5, 95], axis=0)
    assert (upper - lower).min() > 0.2 and np.abs(held["means"]).max() < 100.0


def test_poses_that_are_none_are_refused(mapped):
    for pose, said in [(np.eye(3), "4 x 4"), (2 * np.eye(4), "a rotation"), (np.full((4, 4), np.nan), "a rotation")]:
        with pytest.raises(mba.InputError, match=said):
            mapped.map.render(pose)


def test_what_is_not_there_is_named(place, run):
    with pytest.raises(mba.InputError, match="nowhere"):
        mba.Dataset(place / "nowhere")
    with pytest.raises(mba.InputError, match="is not a run folder"):
        mba.Run.open(place)
    with pytest.raises(mba.InputError, match="has no map"):
        run.map


def test_figures_are_the_usual_ones():
    dark, light = np.zeros((32, 32, 3), np.uint8), np.full((32, 32, 3), 51, np.uint8)
    # An error of a fifth of the peak everywhere.
    assert mba.psnr(dark, light) == pytest.approx(20 * np.log10(5))
    assert mba.psnr(dark, dark) == np.inf and mba.ssim(light, light) == pytest.approx(1.0)
    with pytest.raises(mba.InputError, match="the reference has 32 x 32 pixels, the estimate 32 x 16"):
        mba.psnr(dark, light[:16])
