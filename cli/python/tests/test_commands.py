"""Commands of the program as functions, and the program itself."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import mba

EXAMPLES = Path(__file__).parent.parent / "examples"


def test_a_run_is_that_of_the_program_byte_for_byte(data, run, place):
    out = place / "by_program"
    subprocess.run([sys.executable, "-m", "mba", "track", data, "--out", out, "--quiet"], check=True, stdout=subprocess.DEVNULL)
    assert (out / "exposures.txt").read_bytes() == (run.folder / "exposures.txt").read_bytes()
    for index, path in run.deblurred.items():
        assert path.read_bytes() == (out / "deblurred" / path.name).read_bytes(), index


def test_figures_come_as_numbers(data, mapped):
    figures = mba.evaluate_trajectory(data.folder / "groundtruth.txt", mapped)
    assert figures["matches"] == 12 and figures["ate_m"]["rmse"] < 0.01
    assert figures["ate_m"]["rmse"] == pytest.approx(mapped.summary["trajectory"]["ate_m"]["rmse"], rel=1e-6)
    images = mba.evaluate_images(data.folder / "sharp", mapped.folder / "deblurred", captured=data)
    assert images
    assert mba.info(data)["frames"] == 12


def test_exports_and_meshes(data, mapped, place):
    scene = mba.export(mapped, "nerfstudio", place / "scene")
    transforms = json.loads((scene / "transforms.json").read_text())
    # The axes of OpenGL: y up, z backwards.
    frame = transforms["frames"][0]
    index = int(Path(frame["file_path"]).stem)
    expected = mapped.poses[index] @ np.diag([1.0, -1.0, -1.0, 1.0])
    np.testing.assert_allclose(np.array(frame["transform_matrix"]), expected, atol=1e-6)
    mesh = mba.mesh(mapped, place / "mesh.glb", voxel_cm=4.0)
    assert mesh.read_bytes()[:4] == b"glTF"
    assert mba.report(mapped).read_text().startswith("<!")


def test_progress_is_told_and_may_stop_the_work(data, place):
    told = []
    mba.synth(place / "told", frames=30, size=(320, 240), blur=8, progress=lambda share, what: told.append((share, what)))
    shares = [share for share, _ in told]
    assert shares == sorted(shares) and shares[0] < 0.9 and all(what == "rendering" for _, what in told)

    class Enough(Exception):
        pass

    def stop(share, what):
        raise Enough

    with pytest.raises(Enough):
        mba.synth(place / "not_told", frames=400, size=(640, 480), progress=stop)


def test_ctrl_c_saves_and_the_same_call_goes_on(place):
    data = mba.synth(place / "long", frames=60, size=(320, 240), blur=6)
    whole = mba.track(data, place / "whole", keyframes=False)
    before = time.monotonic()
    timer = threading.Timer(0.4, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt, match="stopped after [0-9]+ of 60 frames"):
        # As long as it takes, and longer than the timer.
        for _ in range(100):
            mba.track(data, place / "cut", keyframes=False)
    timer.join()
    assert time.monotonic() - before < 60
    resumed = mba.track(data, place / "cut", keyframes=False, resume=True)
    np.testing.assert_array_equal(resumed.opening, whole.opening)


def test_other_threads_go_on_meanwhile(data, place):
    """Python's lock is released: a thread counts while a command works."""
    counted = 0
    done = threading.Event()

    def count():
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    before = time.monotonic()
    mba.track(data, place / "beside", keyframes=False)
    seconds = time.monotonic() - before
    done.set()
    thread.join()
    # A thread that sleeps for a millisecond wakes more than twenty times a second.
    assert counted > 20 * seconds


def test_errors_carry_message_and_advice(data, place):
    with pytest.raises(mba.InputError, match="nowhere") as raised:
        mba.track(place / "nowhere", place / "out")
    assert raised.value.hint and isinstance(raised.value, ValueError)
    with pytest.raises(mba.InputError, match="invalid value '0' for '--virtual-views <N>'"):
        mba.track(data, place / "out", virtual_views=0)
    with pytest.raises(mba.InputError, match="--out"):
        mba.command("track", data)
    with pytest.raises(mba.InputError):
        mba.command("fly")


def test_oddities_are_warnings(data, place):
    import shutil

    odd = place / "odd"
    shutil.copytree(data.folder, odd)
    name = (odd / "rgb.txt").read_text().splitlines()[-4].split()[1]
    (odd / name).write_bytes(b"no image")
    with pytest.warns(mba.DataWarning, match="1 frames were skipped"):
        run = mba.track(odd, place / "odd_run", keyframes=False)
    assert run.status.count("lost") == 1


def test_a_job_starts_the_program_again(data, run, place):
    mba.command("split", run, out=place / "job")
    mba.command("map", place / "job", jobs=1)
    assert all(group["state"] == "done" for group in mba.command("status", place / "job")["groups"])
    mba.command("merge", place / "job", out=place / "merged")
    assert len(mba.Run.open(place / "merged").map) > 1000


def test_the_program_answers(place):
    said = subprocess.run([sys.executable, "-m", "mba", "--version"], check=True, capture_output=True, text=True)
    assert said.stdout.startswith("mba ")
    wrong = subprocess.run([sys.executable, "-m", "mba", "info", place / "nowhere"], capture_output=True, text=True)
    assert wrong.returncode == 2 and wrong.stderr.startswith("error: ")


@pytest.mark.parametrize("name", ["camera_loop", "map_recording", "nerfstudio_export", "rerun_log", "lpips_of_run"])
def test_examples_run(name, mapped, place):
    arguments = [mapped.folder] if name in ("rerun_log", "lpips_of_run") else []
    if name == "rerun_log":
        arguments.append(place / "run.rrd")
    script = EXAMPLES / f"{name}.py"
    said = subprocess.run([sys.executable, script, *arguments], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    if said.stdout.startswith("skipped"):
        pytest.skip(said.stdout.strip())
    assert said.stdout
