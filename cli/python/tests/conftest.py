"""What the tests share: one small sequence, tracked and mapped once."""

import numpy as np
import pytest

import mba


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("mba")


@pytest.fixture(scope="session")
def data(place):
    return mba.synth(place / "data", frames=12, size=(160, 120), blur=3)


@pytest.fixture(scope="session")
def run(data, place):
    return mba.track(data, place / "run")


@pytest.fixture(scope="session")
def mapped(data, run, place):
    return mba.map(data, run, place / "mapped")


@pytest.fixture(scope="session")
def in_run_world(data):
    """Takes true poses to the world of a run, which is that of the first camera at mid exposure."""
    _, poses = data.ground_truth
    return np.linalg.inv(poses[0])
