"""`mudskipper joy`: the dead-man, the keys of a terminal, gamepads that vanish."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from command_line import exit_codes
from command_line.operation import joy as joy_module
from command_line.operation.joy import AGAIN_S, HandDrive, joy
from command_line.operation.pads import (
    ARM,
    DEAD_MAN,
    DEEPER,
    DEVICE_KEYS,
    FIRST_REPEAT_S,
    QUIT,
    REPEAT_S,
    SHALLOWER,
    STOP,
    WALK,
    Controls,
    Pad,
    TerminalPad,
    device_pad,
)  # fmt: skip
from drivers.input_keys import InputKeys
from operator_client.status_client import CallRefusedError, StatusClient
from tests.command_line.command_lines import failure, run
from tests.command_line.fake_client import FakeClient
from tests.running_bench import Bench

RELEASED, HELD = Controls(False), Controls(True, frozenset({DEAD_MAN}))
Report = dict[str, Any]


class Driven:
    """A hand drive with its connections, at 0.1 s a step."""

    def __init__(self, *refused: str) -> None:
        self.connections: list[FakeClient] = []
        self.refused, self.now_s = refused, 0.0
        self.drive = HandDrive(self._connect)

    def _connect(self) -> FakeClient:
        refused = {name: CallRefusedError(f"{name}: no") for name in self.refused}
        self.connections.append(FakeClient(refused.get))
        return self.connections[-1]

    def step(self, controls: Controls, mode: str = "hold", steps: int = 1) -> None:
        for _ in range(steps):
            self.drive.step(controls, {"mode": mode, "next_depth_m": 0.03}, self.now_s)
            self.now_s += 0.1

    def press(self, control: str, mode: str = "hold") -> None:
        self.step(Controls(True, frozenset({DEAD_MAN, control})), mode)
        self.step(HELD, mode, steps=5)

    @property
    def calls(self) -> list[str]:
        return [call for each in self.connections for call in each.calls if call != "lease"]


def test_a_stop_that_is_pressed_with_other_controls_is_the_only_one_that_counts() -> None:
    driven = Driven()
    driven.step(RELEASED)
    driven.step(Controls(True, frozenset({DEAD_MAN, ARM, WALK, STOP, DEEPER})), "idle")
    driven.step(Controls(True, frozenset({DEAD_MAN, WALK, STOP})), "hold", steps=8)
    assert set(driven.calls) == {"stop"} and len(driven.calls) > 1


def test_the_lease_lasts_for_as_long_as_the_dead_man_is_held() -> None:
    driven = Driven()
    driven.step(RELEASED)
    driven.step(HELD, steps=10)
    assert driven.drive.engaged and driven.connections[0].calls.count("lease") == 5
    driven.step(RELEASED)
    assert not driven.drive.engaged and driven.connections[0].calls[-1] == "close"
    driven.step(HELD)
    assert len(driven.connections) == 2


def test_a_dead_man_that_is_held_from_the_start_does_nothing() -> None:
    driven = Driven()
    driven.step(HELD, steps=5)
    driven.drive.end()
    assert not driven.connections


def test_a_refused_lease_needs_another_press_of_the_dead_man() -> None:
    driven = Driven("lease")
    driven.step(RELEASED)
    driven.step(HELD, steps=20)
    assert len(driven.connections) == 1 and driven.calls == ["close"] and driven.drive.message == "lease: no"


def test_controls_act_only_while_the_dead_man_is_held() -> None:
    driven = Driven()
    driven.step(Controls(False, frozenset({ARM, WALK})), "idle", steps=5)
    assert not driven.connections
    driven.press(ARM, "idle")
    driven.press(WALK)
    driven.press(WALK, "walking")
    driven.press(STOP, "walking")
    assert driven.calls == ["arm", "walk", "stop"]


def test_the_depth_changes_in_steps_also_before_the_walk() -> None:
    driven = Driven()
    driven.step(RELEASED)
    driven.press(DEEPER)
    driven.press(WALK)
    driven.press(SHALLOWER, "walking")
    driven.step(Controls(True, frozenset({SHALLOWER})), "walking", steps=round(2 * AGAIN_S / 0.1))
    assert driven.calls == ["walk 0.035", "depth 0.03", "depth 0.025", "depth 0.02"]


def test_a_refused_depth_leaves_the_one_before() -> None:
    driven = Driven("depth")
    driven.step(RELEASED)
    driven.press(DEEPER, "walking")
    assert driven.drive.depth_m is None and driven.drive.message == "depth: no"


@pytest.mark.parametrize(
    ("keys", "then_s", "held"),
    [
        ([], 0.0, False),
        ([(0.0, b" ")], FIRST_REPEAT_S, True),
        ([(0.0, b" ")], FIRST_REPEAT_S + 0.01, False),
        ([(0.0, b" "), (0.5, b" "), (0.53, b" ")], 0.53 + REPEAT_S, True),
        ([(0.0, b" "), (0.5, b" "), (0.53, b" ")], 0.54 + REPEAT_S, False),  # a repeating key ends sooner
        ([(0.0, b" "), (0.5, b" "), (0.53, b"\x1b[A")], 0.53 + FIRST_REPEAT_S, True),  # another key repeats later
        ([(0.0, b"x\x1b[C\xff")], 0.01, False),  # no key of ours
    ],
)
def test_a_terminal_holds_the_dead_man_while_a_key_repeats(
    keys: list[tuple[float, bytes]], then_s: float, held: bool
) -> None:
    typed = iter([data for _, data in keys] + [b""])
    pad = TerminalPad(lambda: next(typed))
    for now_s, _ in keys:
        pad(now_s)
    assert pad(then_s).held is held


def test_a_terminal_reports_all_keys_that_came_at_once() -> None:
    assert TerminalPad(lambda: b" w\x1b[B")(0.0) == Controls(True, frozenset({DEAD_MAN, WALK, DEEPER}))


class Gamepad(SimpleNamespace):
    """A module like evdev with one gamepad, whose R1, lower button and cross (down) are pressed."""

    ecodes = SimpleNamespace(
        EV_KEY=1, EV_ABS=3, ecodes={"BTN_TR": 311, "BTN_SOUTH": 304, "BTN_EAST": 305, "KEY_W": 17, "ABS_HAT0Y": 17}
    )
    gone: Exception | None = None

    def list_devices(self) -> list[str]:
        return ["/dev/input/event7"]

    def InputDevice(self, path: str) -> Any:  # noqa: N802
        def active_keys() -> list[int]:
            if self.gone:
                raise self.gone
            return [311, 304]

        capabilities = lambda absinfo: {1: [304, 305, 311], 3: [17]}  # noqa: E731
        absinfo = lambda axis: SimpleNamespace(value=1)  # noqa: E731
        return SimpleNamespace(name="Pad", active_keys=active_keys, capabilities=capabilities, absinfo=absinfo)


@pytest.mark.parametrize("problem", [OSError(19, "No such device"), SystemError()])
def test_a_gamepad_is_read_by_the_names_of_its_keys_until_it_is_gone(
    monkeypatch: pytest.MonkeyPatch, problem: Exception
) -> None:
    gamepad = Gamepad()
    monkeypatch.setitem(sys.modules, "evdev", gamepad)
    pad = device_pad(InputKeys("/dev/input/event7", DEVICE_KEYS))
    assert pad(0.0) == Controls(True, frozenset({DEAD_MAN, WALK, DEEPER}))
    gamepad.gone = problem
    with pytest.raises(OSError):
        pad(0.1)


def test_a_keyboard_of_the_robot_s_own_computer_ends_the_drive_too() -> None:
    keyboard: Any = SimpleNamespace(pressed=lambda: {"KEY_Q"})
    assert device_pad(keyboard)(0.0) == Controls(False, frozenset({QUIT}))


def driven_by(monkeypatch: pytest.MonkeyPatch, bench: Bench, controls: Callable[[Report], Controls]) -> None:
    """Let `joy` read its controls from a function of the robot's state."""

    @contextmanager
    def opened_pad(device: str, keyboard: bool) -> Iterator[Pad]:
        def read(now_s: float) -> Controls:
            with StatusClient(bench.socket) as client:
                return controls(client.call("status"))

        yield read

    monkeypatch.setattr(joy_module, "opened_pad", opened_pad)


def test_the_key_that_ends_a_walk_stops_the_robot_without_a_fault(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []

    def controls(report: Report) -> Controls:
        seen.append(report["mode"])
        pressed = {"idle": ARM, "hold": WALK, "walking": QUIT}.get(report["mode"], DEAD_MAN)
        return Controls(len(seen) > 1, frozenset({pressed}))

    driven_by(monkeypatch, bench, controls)
    assert joy(socket=bench.socket) == exit_codes.OK
    report = bench.wait_for(lambda report: report["mode"] == "idle")
    assert "lease_lost" not in f"{report['notice']} {report['fault']}"


def test_a_gamepad_that_vanishes_stops_the_robot(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []

    def controls(report: Report) -> Controls:
        seen.append(report["mode"])
        if report["phase"] == "stance":
            raise OSError(19, "No such device")
        pressed = {"idle": ARM, "hold": WALK}.get(report["mode"], DEAD_MAN)
        return Controls(len(seen) > 1, frozenset({pressed}))

    driven_by(monkeypatch, bench, controls)
    ended = run("joy", "--socket", str(bench.socket))
    assert ended.returncode == exit_codes.UNHEALTHY and "No such device" in ended.stderr
    assert bench.wait_for(lambda report: report["mode"] not in ("stopping", "fault"))["mode"] in ("hold", "idle")


def test_without_a_gamepad_or_a_terminal_the_message_names_the_options(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "evdev", SimpleNamespace(list_devices=list))
    message = failure("joy")
    assert "--device" in message and "--keyboard" in message
    monkeypatch.setitem(sys.modules, "evdev", None)
    assert "evdev" in failure("joy")
