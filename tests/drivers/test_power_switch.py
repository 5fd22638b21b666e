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


@pytest.mark.parametrize(
    ("value", "cut_value", "cut"),
    [("ACTIVE", 1, True), ("INACTIVE", 1, False), ("ACTIVE", 0, False), ("INACTIVE", 0, True)],
)
def test_a_line_is_read_with_its_polarity(
    monkeypatch: pytest.MonkeyPatch, value: str, cut_value: int, cut: bool
) -> None:
    gpiod, opened = pytest.importorskip("gpiod"), list[Any]()

    def request_lines(path: str, consumer: str, config: Any) -> Any:
        opened.append((path, config))
        return SimpleNamespace(get_value=lambda line: gpiod.line.Value[value])

    monkeypatch.setattr(gpiod, "request_lines", request_lines)
    switch = open_power_switch(EmergencyStopParameters("gpio", "/dev/gpiochip0", 17, cut_value=cut_value))
    pulled_up = gpiod.LineSettings(direction=gpiod.line.Direction.INPUT, bias=gpiod.line.Bias.PULL_UP)
    assert switch and opened == [("/dev/gpiochip0", {17: pulled_up})]
    assert bool([switch.update(1.0), switch.update(2.0)][1]) is cut


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every device be a keyboard of the keys ESC, which is pressed, and A."""
    pressed, keys = [1], [1, 30]
    device = SimpleNamespace(name="", active_keys=lambda: pressed, capabilities=lambda absinfo: {1: keys})
    monkeypatch.setattr(pytest.importorskip("evdev"), "InputDevice", lambda path: device)


@pytest.mark.usefixtures("keyboard")
@pytest.mark.parametrize(("key", "cut"), [("KEY_ESC", True), ("KEY_A", False)])
def test_a_pressed_key_is_a_cut(key: str, cut: bool) -> None:
    switch = open_power_switch(EmergencyStopParameters("key", "/dev/input/event0", key=key))
    assert switch and bool([switch.update(1.0), switch.update(2.0)][1]) is cut


def refusal(source: Any, key: str = "") -> str:
    with pytest.raises(PowerSwitchError) as problem:
        open_power_switch(EmergencyStopParameters(source, "/dev/x", 17, key))
    assert "\n" not in str(problem.value)
    return str(problem.value)


@pytest.mark.parametrize(("source", "library"), [("gpio", "gpiod"), ("key", "evdev")])
def test_a_library_that_is_missing_is_named_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch, source: str, library: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    assert library in refusal(source) and f"{sys.executable} -m pip install" in refusal(source)


@pytest.mark.usefixtures("keyboard")
@pytest.mark.parametrize("key", ["KEY_NONE", "KEY_B", "ABS_HAT0Y"])  # the last is an axis, and no direction of one
def test_a_key_that_the_device_has_not_is_named(key: str) -> None:
    assert key in refusal("key", key) and "no such key" in refusal("key", key)


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (FileNotFoundError(2, "No such file"), "does not open: No such file"),
        (ValueError(22, "Invalid argument"), "does not open: Invalid argument"),  # by gpiod: no such line
        (NotImplementedError(95, "not supported"), "does not open: not supported"),  # no pull-up
    ],
)
def test_a_line_that_does_not_open_says_why(monkeypatch: pytest.MonkeyPatch, problem: Exception, message: str) -> None:
    def request_lines(*_: Any, **__: Any) -> None:
        raise problem

    monkeypatch.setattr(pytest.importorskip("gpiod"), "request_lines", request_lines)
    assert message in refusal("gpio")


@pytest.mark.parametrize(("source", "library"), [("gpio", "gpiod"), ("key", "evdev")])
def test_the_real_libraries_are_called_as_they_want_to_be(source: Any, library: str) -> None:
    pytest.importorskip(library)
    with pytest.raises(PowerSwitchError, match="/dev/null does not open: .*(No such device|Inappropriate ioctl)"):
        open_power_switch(EmergencyStopParameters(source, "/dev/null", 17, "KEY_ESC"))


@pytest.mark.parametrize("source", ["", "drives"])
def test_without_an_input_nothing_is_opened(source: Any) -> None:
    assert open_power_switch(EmergencyStopParameters(source)) is None
