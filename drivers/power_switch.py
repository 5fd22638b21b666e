"""The emergency stop as an input: a GPIO line, or a key of an input device, that says whether the motors' power is cut.

The switch cuts the power by itself; the input only reports it, so that this program can say so. A contact bounces: two
readings in a row count as a cut, and the power is back after RELEASED_S without one. An input that cannot be read any
more counts as a cut. The packages `gpiod` and `evdev` are needed only by a robot that has such an input.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

from control.bounds import Bounds, Meaning
from control.records import NEVER_S
from drivers.input_keys import InputKeys

READ_S = 0.01  # between two readings
RELEASED_S = 0.2  # a contact bounces for some 10 ms
INSTALL = f"'{sys.executable} -m pip install gpiod evdev-binary'"  # mudskipper at PyPI is another project


@dataclass(frozen=True)
class EmergencyStopParameters:
    """What says that the motors' power is cut, besides the silence of all drives at once."""

    source: Annotated[
        Literal["", "gpio", "key", "drives"],
        Meaning("of the cut: a GPIO line, a key, or a drive that reports it; empty: only the silence of all drives"),
    ] = ""
    device: Annotated[str, Meaning("of the line or key: /dev/gpiochip0, or a path in /dev/input/by-id")] = ""
    line: Annotated[int, Bounds(0, 1023), Meaning("of the GPIO chip", "number")] = 0
    key: Annotated[str, Meaning("of the input device, such as KEY_ESC or BTN_TRIGGER")] = ""
    cut_value: Annotated[
        int,
        Bounds(0, 1),
        Meaning("of the line or key while the power is cut; 1: a line that is open, a pressed key", "level"),
    ] = 1


class PowerSwitchError(Exception):
    """The input does not open; the text says why and what to do."""


class PowerSwitch:
    """Owns the state of the switch."""

    def __init__(self, read: Callable[[], bool], name: str) -> None:
        """`read` returns whether the power is cut; it raises OSError where the input is gone."""
        self._read, self._name = read, name
        self._read_s = self._cut_s = NEVER_S
        self._was_cut = False
        self.reason = ""  # why the power counts as cut; empty: it does not

    def update(self, now_s: float) -> str:
        """Read the input if it is due; return the reason. It is called in every tick."""
        if now_s - self._read_s < READ_S:
            return self.reason
        self._read_s = now_s
        try:
            cut, reason = self._read(), f"{self._name} says so"
        except OSError:
            cut, reason = True, f"{self._name} cannot be read any more; once it is back, restart the daemon"
        if cut:
            self._cut_s = now_s
            self.reason = reason if self._was_cut else self.reason
        elif now_s - self._cut_s > RELEASED_S:
            self.reason = ""
        self._was_cut = cut
        return self.reason


def open_power_switch(parameters: EmergencyStopParameters) -> PowerSwitch | None:
    """Open the input, where one is configured. Raises PowerSwitchError."""
    device, cut = parameters.device, bool(parameters.cut_value)
    name = f"line {parameters.line} of {device}" if parameters.source == "gpio" else f"{parameters.key} of {device}"
    try:
        match parameters.source:
            case "gpio":
                read = _open_line(device, parameters.line)
            case "key":
                read = _open_key(device, parameters.key)
            case _:
                return None
    except ImportError as problem:
        raise PowerSwitchError(f"emergency_stop.source = {parameters.source!r}: {problem}; {INSTALL}") from problem
    except (OSError, ValueError, NotImplementedError) as problem:  # gpiod raises the latter for EINVAL, EOPNOTSUPP
        reason = getattr(problem, "strerror", None) or problem.args[-1]
        raise PowerSwitchError(f"emergency_stop: {name} does not open: {reason}") from problem
    return PowerSwitch(lambda: read() is cut, name)


def _open_line(device: str, line: int) -> Callable[[], bool]:
    import gpiod
    from gpiod.line import Bias, Direction, Value

    settings = gpiod.LineSettings(direction=Direction.INPUT, bias=Bias.PULL_UP)
    request = gpiod.request_lines(device, consumer="mudskipper", config={line: settings})
    return lambda: bool(request.get_value(line) is Value.ACTIVE)


def _open_key(device: str, key: str) -> Callable[[], bool]:
    opened = InputKeys(device, [key])
    if key not in opened.keys:
        raise PowerSwitchError(f"emergency_stop.key = {key!r}: {device} has no such key; 'evtest' names its keys")
    return lambda: key in opened.pressed()
