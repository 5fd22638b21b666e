"""Poses of the authors' walks pass the whole path: NatNet frames over UDP, read tick by tick with the joints.

The steps must equal those in the log. The motion in the capture is computed here from the log's own columns; that a
reader finds it at any heading is tested with a known truth in tests/logs/lab/test_body_track.py.
"""

import gzip
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from control.geometry import FlipperGeometry
from control.records import Phase
from drivers.pose.natnet_client import NatNetClient
from drivers.pose.natnet_port import NatNetPort
from drivers.pose.natnet_sockets import NatNetParameters
from estimation.estimation_parameters import EstimationParameters
from estimation.mud import MudEstimator
from estimation.recorded_states import recorded_states
from logs.lab.lab_csv import read_lab_csv
from logs.replay import LAB_DRIVE, NO_VELOCITY
from simulation.devices.natnet_server import LOOPBACK, NatNetServer, RecordedPose
from tests.folders import SHARED_DATA

Floats = NDArray[np.float64]
WALKS = sorted((SHARED_DATA / "flipper_in_mud").glob("walk_*.csv.gz"))
PHASES = tuple(Phase)
INSERTION, STANCE = 2, 3  # of turtle_state
HORIZONTAL = (1.0, 0.0, 1.0)  # the capture's y is its vertical: a body that sinks does not advance
FROZEN_S, JUMP_M = 0.5, 0.02
BOUND_M = 0.003

pytestmark = pytest.mark.skipif(not WALKS, reason="the shared measurements are not next to the repository")
each_walk = pytest.mark.parametrize("path", WALKS, ids=lambda path: path.name.removesuffix(".csv.gz"))
each_latency = pytest.mark.parametrize("latency_s", [0.0, 0.008])  # from exposure to arrival: none, and a usual one


class Capture(NamedTuple):
    """The body's motion according to the log."""

    time_s: Floats
    position_m: Floats  # (n, 3)
    first: NDArray[np.int64]  # rows in which a pose is new
    lost: NDArray[np.bool_]  # rows of a pose that was held until it jumped
    direction: Floats  # the stances' horizontal motion
    x_m: Floats  # along that; NaN where the capture was lost
    insertions: NDArray[np.int64]  # rows in which one begins


@cache
def capture_of(path: Path) -> Capture:
    lines = gzip.decompress(path.read_bytes()).decode().splitlines()
    head = next(number for number, line in enumerate(lines) if line.startswith("time,"))
    names = [name.strip() for name in lines[head].split(",")]
    table = np.loadtxt(lines[head + 1 :], delimiter=",")
    time_s, state = (table[:, names.index(name)] for name in ("time", "turtle_state"))
    position_m = table[:, [names.index(f"OptitrackPosition_{axis}") for axis in "xyz"]]
    first = np.flatnonzero(np.any(np.diff(position_m, axis=0, prepend=np.nan) != 0.0, axis=1))
    ends = np.append(first[1:], len(time_s))
    leaps_m = np.append(np.linalg.norm(np.diff(position_m[first], axis=0), axis=1), 0.0)
    lost = np.repeat((time_s[ends - 1] - time_s[first] > FROZEN_S) & (leaps_m > JUMP_M), ends - first)
    inside = (state[1:] == STANCE) & (state[:-1] == STANCE) & ~lost[1:] & ~lost[:-1]
    path_m = np.diff(position_m, axis=0)[inside].sum(axis=0) * HORIZONTAL
    direction = path_m / np.linalg.norm(path_m)
    x_m = np.where(lost, np.nan, position_m @ direction)
    insertions = np.flatnonzero((state[1:] == INSERTION) & (state[:-1] != INSERTION)) + 1
    return Capture(time_s, position_m, first, lost, direction, x_m, insertions)


class Walked(NamedTuple):
    """The estimates that the robot would have had."""

    x_m: Floats  # of each row
    ends: NDArray[np.int64]  # rows in which a stride of the left flipper closed
    steps_m: Floats  # of those strides, by the estimator


@cache
def walked(path: Path, latency_s: float) -> Walked:
    """Run the log row by row, with its own time, through NatNet and the estimator."""
    capture, lab = capture_of(path), read_lab_csv(path)
    poses = [RecordedPose(float(capture.time_s[row]), tuple(capture.position_m[row].tolist())) for row in capture.first]
    server = NatNetServer(poses, latency_s=latency_s, crowded=True)
    x, y, z = capture.direction.tolist()
    parameters = NatNetParameters(server=LOOPBACK, group="", command_port=server.address[1])
    estimator = MudEstimator(FlipperGeometry(), (LAB_DRIVE, LAB_DRIVE), EstimationParameters())
    positions_m, ends, steps_m = [], [], []
    rows = zip(*(each.tolist() for each in (lab.stamp_s, lab.phase, lab.angle_rad, lab.current_a)), strict=True)
    with closing(server), closing(NatNetPort(NatNetClient(parameters, (x, y, z)))) as port:
        for now_s in (-2.0, -1.0):  # connects before the log begins
            port.read(now_s)
            server.step(now_s)
        for row, (now_s, phase, angles_rad, currents_a) in enumerate(rows):
            server.step(now_s)
            body = port.read(now_s)
            states = recorded_states(now_s, angles_rad, NO_VELOCITY, currents_a)
            strides = estimator.update(now_s, PHASES[phase], states, body).strides
            positions_m.append(body.x_m)
            ends += [row for stride in strides if stride.flipper == "left"]
            steps_m += [stride.step_m for stride in strides if stride.flipper == "left"]
        assert port.report().malformed == 0
    return Walked(np.array(positions_m), np.array(ends), np.array(steps_m))


@each_latency
@each_walk
def test_steps_are_those_of_the_capture(path: Path, latency_s: float) -> None:
    """From insertion to insertion no step is missing if the capture has both ends, and none is invented if it lacks
    one. The estimator's steps are those between the ticks in which its strides close, when swing begins.
    """
    capture, known = capture_of(path), walked(path, latency_s)
    true_m, reported_m = np.diff(capture.x_m[capture.insertions]), np.diff(known.x_m[capture.insertions])
    seen = np.isfinite(true_m)
    assert min(len(true_m), len(known.ends)) >= 2
    assert not np.any(np.isfinite(reported_m[~seen]))
    assert np.all(np.abs(reported_m - true_m)[seen & np.isfinite(reported_m)] < BOUND_M)
    if latency_s == 0.0:
        assert np.all(np.isfinite(reported_m[seen]))
    assert np.all(np.abs(known.steps_m[1:] - np.diff(capture.x_m[known.ends])) < BOUND_M)


@each_walk
def test_the_position_is_that_of_the_capture_at_all_times(path: Path) -> None:
    capture, known = capture_of(path), walked(path, 0.0)
    error_m = np.abs(known.x_m - capture.x_m)
    error_m = error_m[np.isfinite(error_m)]
    assert len(error_m) > 0.75 * np.count_nonzero(~capture.lost)
    assert np.sqrt(np.mean(error_m**2)) < 0.0005 and error_m.max() < 0.01
