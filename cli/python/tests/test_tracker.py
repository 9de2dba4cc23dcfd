"""The tracker frame by frame."""

import numpy as np
import pytest

import mba


def tracked(data, tracker, **changes):
    """Results of all frames, with the images changed by functions."""
    colour = changes.get("rgb", lambda image: image)
    depth = changes.get("depth", lambda image: image)
    return [
        tracker.track(colour(frame.rgb), depth(frame.depth), frame.timestamp, exposure=frame.exposure_seconds)
        for frame in data
    ]


def test_poses_of_shutter_opening_and_closing_are_those_of_the_truth(data, in_run_world):
    results = tracked(data, mba.Tracker(data.camera))
    _, opening, middle, closing = data.ground_truth_exposures
    assert [result.status for result in results] == ["ok"] * len(data)
    # The first frame learns its motion from the second.
    for result in results[1:]:
        # A pixel at the distance of the walls, 2.5 m, and in angle.
        for estimate, truth in [(result.opening, opening), (result.middle, middle), (result.closing, closing)]:
            error = np.linalg.inv(in_run_world @ truth[result.index]) @ estimate
            assert np.linalg.norm(error[:3, 3]) < 0.02
            assert np.degrees(np.arccos((np.trace(error[:3, :3]) - 1) / 2)) < 0.5
    # The camera moves: the ends are apart, in the true direction.
    true_motion = [in_run_world[:3, :3] @ (closing[k, :3, 3] - opening[k, :3, 3]) for k in range(1, len(data))]
    motion = [result.closing[:3, 3] - result.opening[:3, 3] for result in results[1:]]
    assert np.linalg.norm(true_motion, axis=1).mean() > 0.005
    assert np.sum(np.multiply(true_motion, motion)) > 0.9 * np.sum(np.square(true_motion))
    first = results[1].revision
    assert first is not None and first.index == 0 and first.blur_px > 0.5


def test_frames_give_what_the_program_gives(data, place):
    """Bit for bit, where no later frame has revised one."""
    run = mba.track(data, place / "frame_by_frame", hindsight=False)
    results = tracked(data, mba.Tracker(data.camera))
    revised = {result.revision.index for result in results if result.revision is not None}
    kept = [result for result in results if result.index not in revised]
    assert len(kept) > 6
    for result in kept:
        # The file has nine decimals.
        np.testing.assert_allclose(result.opening, run.opening[result.index], atol=2e-8)
        np.testing.assert_allclose(result.closing, run.closing[result.index], atol=2e-8)
        assert result.is_keyframe == run.is_keyframe[result.index]


def test_strides_metres_and_reset_change_nothing(data):
    tracker = mba.Tracker(data.camera)
    expected = [result.opening for result in tracked(data, tracker)]

    def padded(image):
        wide = np.zeros((image.shape[0], image.shape[1] + 5, *image.shape[2:]), image.dtype)
        wide[:, 2:-3] = image
        return wide[:, 2:-3]

    scale = data.camera.depth_scale
    variants = [
        dict(rgb=padded, depth=padded),
        dict(rgb=np.asfortranarray),
        dict(depth=lambda depth: depth / scale),
        dict(depth=lambda depth: (depth / scale).astype(np.float32)),
    ]
    for variant in variants:
        tracker.reset()
        for result, pose in zip(tracked(data, tracker, **variant), expected):
            np.testing.assert_array_equal(result.opening, pose)


def test_missing_depth_in_metres_is_missing(data):
    frame = data[0]
    metres = frame.depth / data.camera.depth_scale
    metres[frame.depth == 0] = np.nan
    metres[3, 4] = np.inf
    raw = frame.depth.copy()
    raw[3, 4] = 0
    results = []
    for depth in (metres, raw):
        tracker = mba.Tracker(data.camera)
        tracker.track(frame.rgb, depth, 0.0, exposure=0.01)
        results.append(tracker.track(data[1].rgb, data[1].depth, 1 / 30, exposure=0.01).opening)
    np.testing.assert_array_equal(*results)


def test_grey_images_and_views_of_a_map_are_taken(data, mapped):
    grey = tracked(data, mba.Tracker(data.camera), rgb=lambda rgb: rgb[:, :, 1])
    assert all(result.status != "lost" for result in grey)
    tracker = mba.Tracker(data.camera)
    tracker.track(data[0].rgb, data[0].depth, 0.0, exposure=data[0].exposure_seconds)
    view = mapped.map.render(mapped.poses[0])
    tracker.set_reference(view.rgb, view.depth, mapped.poses[0])
    result = tracker.track(data[1].rgb, data[1].depth, 1 / 30, exposure=data[1].exposure_seconds)
    assert result.status == "ok"


@pytest.mark.parametrize(
    ("rgb", "depth", "said"),
    [
        (np.zeros((120, 160, 3), np.float32), None, "rgb: bytes of shape"),
        (np.zeros((120, 160, 4), np.uint8), None, "not uint8 of shape [120, 160, 4]"),
        (None, np.zeros((120, 160), np.int64), "depth: uint16 (raw units) or floating-point numbers"),
        (np.zeros((60, 80, 3), np.uint8), None, "image is 80x60, the calibration says 160x120"),
        ("a picture", None, "rgb: bytes of shape"),
    ],
)
def test_images_that_do_not_fit_are_refused(data, rgb, depth, said):
    frame = data[0]
    tracker = mba.Tracker(data.camera)
    colour = frame.rgb if rgb is None else rgb
    with pytest.raises(mba.InputError) as raised:
        tracker.track(colour, frame.depth if depth is None else depth, 0.0, exposure=0.01)
    assert said in str(raised.value)


def test_a_refused_frame_leaves_the_tracker_as_it_was(data):
    tracker = mba.Tracker(data.camera)
    first = data[0]
    tracker.track(first.rgb, first.depth, 1.0, exposure=0.01)
    with pytest.raises(mba.FrameError, match="timestamp 0.500000 s does not follow 1.000000 s"):
        tracker.track(first.rgb, first.depth, 0.5, exposure=0.01)
    with pytest.raises(mba.FrameError, match="exposure of -1 s is not a duration"):
        tracker.track(first.rgb, first.depth, 2.0, exposure=-1.0)
    assert tracker.track(first.rgb, first.depth, 3.0, exposure=0.01).index == 1


def test_settings_that_no_tracker_has_are_refused():
    camera = mba.Camera(160, 120, 125.0, 125.0, 79.5, 59.5)
    with pytest.raises(mba.ConfigError, match="reference = sharp"):
        mba.Tracker(camera, reference="sharp")
    with pytest.raises(mba.ConfigError, match="virtual_views = 0"):
        mba.Tracker(camera, virtual_views=0)
    with pytest.raises(mba.InputError, match="fx"):
        mba.Tracker(mba.Camera(160, 120, -1.0, 125.0, 79.5, 59.5))
    with pytest.raises(mba.InputError, match="camera: response = gamma"):
        mba.Tracker(mba.Camera(160, 120, 125.0, 125.0, 79.5, 59.5, response="gamma"))
