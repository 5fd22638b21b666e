"""A port over python-can: frames pass, failures are counted, and no call waits or raises."""

import time
from collections.abc import Callable
from math import inf
from pathlib import Path

import can
import pytest

from control.records import NEVER_S
from drivers.can.can_port import CanPort, PythonCanPort, open_port
from drivers.can.frames import Frame
from drivers.can.port_health import MOST_FRAMES_PER_READ
from drivers.can.stamp_clock import StampClock


class FakeBus(can.BusABC):
    """Receives the same message a number of times."""

    def __init__(self, answers: int = 0) -> None:
        super().__init__(channel="fake")
        self.answers = answers
        self.timeouts: list[float | None] = []

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self.timeouts.append(timeout)
        self.answers -= 1
        return can.Message(arbitration_id=9, is_extended_id=False) if self.answers >= 0 else None

    def send(self, msg: can.Message, timeout: float | None = None) -> None: ...


class Clocks:
    """A monotonic clock and a wall clock that may be stepped."""

    def __init__(self) -> None:
        self.time_s, self.step_s = 1000.0, 0.0

    def monotonic_s(self) -> float:
        return self.time_s

    def wall_s(self) -> float:
        return 1.7e9 + self.time_s + self.step_s


def stamps_are_right(send: Callable[[], object], port: CanPort) -> bool:
    """Return whether one of many frames is stamped when it was sent: others may interrupt two looks at the clocks."""

    def is_right() -> bool:
        before_s = time.monotonic()
        send()
        after_s = time.monotonic()
        time.sleep(0.02)
        (frame,) = port.receive()
        return before_s - 0.005 < frame.stamp_s < after_s + 0.005

    return any(is_right() for _ in range(50))


def test_nothing_is_waited_for_and_the_next_read_takes_the_rest() -> None:
    bus = FakeBus(MOST_FRAMES_PER_READ + 5)
    port = PythonCanPort(bus)
    assert [len(port.receive()) for _ in range(2)] == [MOST_FRAMES_PER_READ, 5]
    assert {*bus.timeouts} == {0.0}


@pytest.mark.parametrize(("interface", "options"), [("virtual", {"receive_own_messages": True}), ("udp_multicast", {})])
def test_a_bus_that_returns_own_frames_is_refused(interface: str, options: dict[str, bool]) -> None:
    """Such frames would look like the commands of another program."""
    with pytest.raises(ValueError, match="its own frames"):
        open_port(interface, "own-messages", dict(options))


def test_a_user_s_configuration_of_python_can_is_not_merged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / ".canrc"
    file.write_text("[default]\ninterface = virtual\nchannel = theirs\nreceive_own_messages = True\n")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("CAN_CONFIG", '{"receive_own_messages": true, "rx_queue_size": 1}')
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(file)])
    port, other = open_port("virtual", "ours", {}), open_port("virtual", "ours", {})
    port.send(Frame(1))
    port.send(Frame(2))
    assert port.receive() == []
    assert [frame.arbitration_id for frame in other.receive()] == [1, 2]
    port.close()
    other.close()


STEPS_S = (-2.0, -0.5, -0.01, -0.002, 0.002, 0.01, 0.05, 0.5, 1.0, 2.0)


@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("during", [False, True], ids=["between two reads", "during a read"])
def test_stamps_of_a_read_that_a_step_of_the_wall_clock_divides_are_ignored(step_s: float, during: bool) -> None:
    now = Clocks()

    class Stamping(FakeBus):
        steps_s = 0.0  # after the first frame of a read

        def recv(self, timeout: float | None = None) -> can.Message | None:
            message = super().recv(timeout)
            if message is not None:
                message.timestamp = now.wall_s()
                now.step_s, self.steps_s = now.step_s + self.steps_s, 0.0
            return message

    bus = Stamping()
    port = PythonCanPort(bus, StampClock(now.monotonic_s, now.wall_s))
    ages_s: list[list[float]] = []
    for number in range(4):
        now.time_s += 0.002
        if number == 1 and during:
            bus.steps_s = step_s
        elif number == 1:
            now.step_s += step_s
        bus.answers = 2
        ages_s.append([now.time_s - frame.stamp_s for frame in port.receive()])
    known = [[age_s == pytest.approx(0.0, abs=1e-6) for age_s in read] for read in ages_s]
    assert known == [[True, True], [False, False], [True, True], [True, True]]
    assert ages_s[1] == [inf, inf]


def test_a_slewed_clock_keeps_its_stamps() -> None:
    now = Clocks()
    clock = StampClock(now.monotonic_s, now.wall_s)
    for _ in range(1000):
        now.time_s += 0.0026
        now.step_s += 0.0026 * 500e-6
        assert clock.offset_s() > NEVER_S
