"""Malformed and unexpected CAN frames raise nothing, and let no frame leave that could move a drive.

An example is what arrives in one tick: frames of simulated drives with other bytes, lengths, ids or marks, random
frames, or bursts of one frame, as a babbling node sends. Each goes to a robot in boot, where the frames of one drive
never come, and to one that is idle, among the true messages of its drives.
"""

from struct import pack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.modes import Mode, Request
from drivers.can.frames import DATA_MAX_BYTES, EXTENDED_MASK, STANDARD_MASK, Frame
from drivers.drive import FD, DriveParameters
from drivers.drive_types import type_of
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.firmware_host.observed_loop import Observer
from verification.example_robot import load_example

TRACK = Track([(1.0, MUDS["48.5"])])
TYPES = ("odrive", "odrive05", "moteus", "mit", "mit:AK80-9", "mit:RS05")
FD_BYTES = 64  # of the longest CAN FD frame
RECORDED_TICKS = 400  # from the start on, in which the drives' settings are read
BABBLE_FRAMES = 400
NUMBERS = [pack("<f", number) for number in (float("nan"), float("inf"), -0.0, 1e38, -3.4e38, 1e-45, 0.5)]
STAMPS_S = [0.0, 1e9, -1.0, float("nan")]


def waiting_robot(drive: str, mode: Mode) -> Lockstep:
    """Make a robot that stays in this mode; in boot its drives are disconnected."""
    robot = Lockstep(load_example(drive), TRACK)
    if mode is Mode.BOOT:
        for bus in robot.buses.values():
            bus.ports[0].close()
    else:
        assert robot.run_until(lambda: robot.loop.mode is mode, 2.0)
    return robot


def true_frames(drive: str) -> list[Frame]:
    """Return frames of simulated drives from start to idle, one of each id and length."""
    robot = Lockstep(load_example(drive), TRACK)
    nodes = [bus.open() for bus in robot.buses.values()]
    robot.run_for(RECORDED_TICKS * robot.period_s)
    frames = [frame for node in nodes for frame in node.receive()]
    return list({(frame.arbitration_id, len(frame.data)): frame for frame in frames}.values())


def announces(frame: Frame, drive: DriveParameters) -> bool:
    """Return whether the loop may take a frame for this drive's heartbeat, or its answer."""
    content = type_of(drive).read_frame(frame)
    identifier = frame.arbitration_id | FD * frame.is_fd
    return identifier in type_of(drive).identifiers(drive) and (content is None or "heartbeat" in content.signals)


def malformed_frames(true: list[Frame]) -> st.SearchStrategy[Frame]:
    longest = FD_BYTES if true[0].is_fd else DATA_MAX_BYTES

    def changed(frame: Frame, at: int, data: bytes, size: int) -> Frame:
        return frame._replace(data=(frame.data[:at] + data + frame.data[at + len(data) :])[:size])

    sizes, payloads = st.integers(0, longest), st.binary(max_size=longest)
    ids = st.sampled_from([frame.arbitration_id for frame in true]) | st.integers(0, STANDARD_MASK)
    marks = [st.booleans()] * 3
    return st.one_of(
        st.builds(changed, st.sampled_from(true), sizes, payloads | st.sampled_from(NUMBERS), st.just(longest) | sizes),
        st.builds(lambda frame, other: frame._replace(arbitration_id=other), st.sampled_from(true), ids),
        st.builds(
            Frame,
            ids | st.integers(0, EXTENDED_MASK),
            payloads,
            *marks,
            st.sampled_from(STAMPS_S),
            st.just(true[0].is_fd),
        ),
    )


@pytest.mark.parametrize("drive", TYPES)
def test_malformed_frames_move_no_drive(drive: str) -> None:
    modes = (Mode.BOOT, Mode.IDLE)
    robots = [waiting_robot(drive, mode) for mode in modes]
    observers = [Observer(robot) for robot in robots]
    silent = next(iter(robots[0].loop.configuration.drive.values()))
    frames = malformed_frames(true_frames(drive)).filter(lambda frame: not announces(frame, silent))

    @given(st.lists(frames, max_size=40) | frames.map(lambda frame: [frame] * BABBLE_FRAMES))
    def arrive(arriving: list[Frame]) -> None:
        for mode, robot, observer in zip(modes, robots, observers, strict=True):
            observer.tick(arriving, with_drives=mode is Mode.IDLE)
            assert robot.loop.mode is mode
            assert not observer.energises and not any(robot.loop.sent.torques_nm)

    arrive()
    assert observers[1].frames > 100


@pytest.mark.parametrize("drive", TYPES)
def test_a_robot_that_is_armed_is_noticed(drive: str) -> None:
    robot = waiting_robot(drive, Mode.IDLE)
    assert robot.run_until(lambda: not robot.loop.faults.blocking("watchdog_unknown"), 2.0)
    observer = Observer(robot)
    assert robot.loop.request(Request.ARM, robot.now_s, forced="watchdog_unknown") is None
    for _ in range(10):
        observer.tick()
    assert observer.energises
