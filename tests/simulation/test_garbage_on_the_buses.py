"""Garbage on the buses of a whole loop that is not armed: it goes on, and no drive gets torque or is asked for it.

`python -m benchmarks.stress.can_fuzz` does the same with a million frames; here hypothesis looks for the one that
matters.
"""

from struct import pack

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.example_robot import load_example
from control.modes import Mode
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockPort
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.track import Track

ANY_ID = st.integers(0, 0x7FF) | st.integers(0, 0x07F)
ANY_DATA = st.binary(max_size=8) | st.tuples(st.floats(width=32), st.floats(width=32)).map(
    lambda two: pack("<ff", *two)
)
ANY_STAMP = st.floats()
ANY_FRAME = st.builds(Frame, ANY_ID, ANY_DATA, st.booleans(), st.booleans(), st.booleans(), ANY_STAMP)
ANY_TICKS = st.lists(st.lists(ANY_FRAME, max_size=20), min_size=1, max_size=5)


@pytest.mark.parametrize("mode", [Mode.BOOT, Mode.IDLE])
def test_no_garbage_stops_a_loop_that_is_not_armed_or_brings_torque_to_a_drive(mode: Mode) -> None:
    walk = Lockstep(load_example(), Track([(1.0, MUDS["48.5"])]))
    if mode is Mode.IDLE:
        assert walk.run_until(lambda: walk.loop.mode is Mode.IDLE, 2.0)
    far = [port.open_peer() for port in walk.loop.drives.ports.values() if isinstance(port, MockPort)]
    assert far

    @settings(max_examples=100, deadline=None)
    @given(ANY_TICKS)
    def examine(ticks: list[list[Frame]]) -> None:
        for frames in ticks:
            for place, frame in enumerate(frames):
                far[place % len(far)].send(frame)
            for port in far:
                port.receive()
            walk.step()
            sent = [frame for port in far for frame in port.receive()]
            assert not any(frame.data == b"\x08\0\0\0" for frame in sent if frame.arbitration_id & 0x1F == 0x07)
            assert not any(any(frame.data[:3]) for frame in sent if frame.arbitration_id & 0x1F == 0x0E)
            assert walk.loop.mode in (Mode.BOOT, Mode.IDLE)

    examine()
    assert walk.loop.drives.refused_commands == 0
    assert walk.loop.drives.unknown_frames > 0
