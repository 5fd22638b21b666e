"""The input of the emergency stop: bouncing contacts, inputs that vanish, and what does not open."""

import sys
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.power_switch import (
    READ_S,
    RELEASED_S,
    EmergencyStopParameters,
    PowerSwitch,
    PowerSwitchError,
    open_power_switch,
)

STEP_S = READ_S + 1e-6


def states(readings: Iterable[Any]) -> list[bool]:
    """Return for each reading whether the power counts as cut."""
    given = iter(readings)

    def read() -> bool:
        reading = next(given)
        if isinstance(reading, Exception):
            raise reading
        return bool(reading)

    switch, now_s, found = PowerSwitch(read, "line 3"), 1.0, []
    while True:
        try:
            found.append(switch.update(now_s) != "")
        except StopIteration:
            return found
        assert switch.update(now_s + 0.5 * READ_S) == switch.reason  # not read again so soon
        now_s += STEP_S


RELEASED = [0] * (int(RELEASED_S / STEP_S) + 1)


@pytest.mark.parametrize(
    ("readings", "cut"),
    [
        ([0, 1, 0, 0, 1, 0], [False] * 6),  # single spikes
        ([0, 1, 1, 0, 1, 0, 0, 1], [False, False, *[True] * 6]),  # bounces once it is cut
        ([1, 1, *RELEASED], [False, *[True] * 20, False]),
        ([1, 1, *RELEASED[:-1], 1, *RELEASED], [False, *[True] * 40, False]),  # the release bounces
        ([0, OSError("gone"), OSError(), 0], [False, False, True, True]),
    ],
)
def test_a_contact_bounces_and_an_input_that_vanishes_counts_as_cut(readings: list[Any], cut: list[bool]) -> None:
    assert states(readings) == cut


def test_an_input_that_vanished_names_the_way_back() -> None:
    switch = PowerSwitch(lambda: bool(Path("/none").stat()), "line 3")
    assert "restart the daemon" in [switch.update(1.0), switch.update(2.0)][1]


def gpio(value: Any, opened: list[Any]) -> dict[str, Any]:
    """Return a module like gpiod 2 with one line."""
    words = SimpleNamespace(ACTIVE="active", INACTIVE="inactive", INPUT="input", PULL_UP="pull up")

    def request_lines(path: str, consumer: str, config: Any) -> Any:
        opened.append((path, config))
        return SimpleNamespace(get_value=lambda line: value)

    line = SimpleNamespace(Bias=words, Direction=words, Value=words)
    settings = lambda **given: given  # noqa: E731
    return {"gpiod": SimpleNamespace(request_lines=request_lines, LineSettings=settings, line=line), "gpiod.line": line}


class Evdev(SimpleNamespace):
    """A module like evdev with one device, whose key 1 is pressed."""

    ecodes = SimpleNamespace(ecodes={"KEY_ESC": 1, "KEY_A": 30, "KEY_B": 48}, EV_KEY=1, EV_ABS=3)

    @staticmethod
    def InputDevice(path: str) -> Any:  # noqa: N802
        return SimpleNamespace(name="", active_keys=lambda: [1], capabilities=lambda absinfo: {1: [1, 30]})


@pytest.mark.parametrize(
    ("value", "cut_value", "cut"),
    [("active", 1, True), ("inactive", 1, False), ("active", 0, False), ("inactive", 0, True)],
)
def test_a_line_is_read_with_its_polarity(
    monkeypatch: pytest.MonkeyPatch, value: str, cut_value: int, cut: bool
) -> None:
    opened: list[Any] = []
    for name, module in gpio(value, opened).items():
        monkeypatch.setitem(sys.modules, name, module)
    switch = open_power_switch(EmergencyStopParameters("gpio", "/dev/gpiochip0", 17, cut_value=cut_value))
    assert switch and opened == [("/dev/gpiochip0", {17: {"direction": "input", "bias": "pull up"}})]
    assert bool([switch.update(1.0), switch.update(2.0)][1]) is cut


@pytest.mark.parametrize(("key", "cut"), [("KEY_ESC", True), ("KEY_A", False)])
def test_a_pressed_key_is_a_cut(monkeypatch: pytest.MonkeyPatch, key: str, cut: bool) -> None:
    monkeypatch.setitem(sys.modules, "evdev", Evdev())
    switch = open_power_switch(EmergencyStopParameters("key", "/dev/input/event0", key=key))
    assert switch and bool([switch.update(1.0), switch.update(2.0)][1]) is cut


@pytest.mark.parametrize(
    ("source", "key", "module", "message"),
    [
        ("gpio", "", None, f"{sys.executable} -m pip install"),
        ("key", "KEY_A", None, f"{sys.executable} -m pip install"),
        ("key", "KEY_NONE", Evdev(), "KEY_NONE"),
        ("key", "KEY_B", Evdev(), "no such key"),
        ("key", "ABS_HAT0Y", Evdev(), "no such key"),  # an axis, and no direction of one
        ("gpio", "", FileNotFoundError(2, "No such file"), "does not open: No such file"),
        ("gpio", "", ValueError(22, "Invalid argument"), "does not open: Invalid argument"),  # by gpiod: no such line
        ("gpio", "", NotImplementedError(95, "not supported"), "does not open: not supported"),  # no pull-up
    ],
)
def test_an_input_that_does_not_open_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, source: Any, key: str, module: Any, message: str
) -> None:
    modules = {"gpiod": module, "evdev": module}
    if isinstance(module, Exception):
        modules = gpio("", [])
        modules["gpiod"].request_lines = lambda *_, **__: (_ for _ in ()).throw(module)
    for name, each in modules.items():
        monkeypatch.setitem(sys.modules, name, each)
    with pytest.raises(PowerSwitchError) as problem:
        open_power_switch(EmergencyStopParameters(source, "/dev/x", 17, key))
    assert message in str(problem.value) and "\n" not in str(problem.value)


@pytest.mark.parametrize(("source", "library"), [("gpio", "gpiod"), ("key", "evdev")])
def test_the_real_libraries_are_called_as_they_want_to_be(source: Any, library: str) -> None:
    pytest.importorskip(library)
    with pytest.raises(PowerSwitchError, match="/dev/null does not open: .*(No such device|Inappropriate ioctl)"):
        open_power_switch(EmergencyStopParameters(source, "/dev/null", 17, "KEY_ESC"))


@pytest.mark.parametrize("source", ["", "drives"])
def test_without_an_input_nothing_is_opened(source: Any) -> None:
    assert open_power_switch(EmergencyStopParameters(source)) is None
