"""What drives a robot by hand: a gamepad, or the keys of a terminal. Each says which controls are pressed.

An input device reports the release of a key. A terminal does not: it repeats a key that is held, first after the delay
that is set in the operator's desktop (0.25 to 0.66 s), then about 30 times a second.
"""

import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple, TypeAlias

from drivers.input_keys import InputKeys

FIRST_REPEAT_S = 0.8  # from a key to its first repetition, at most
REPEAT_S = 0.3  # between two repetitions, at most
DEAD_MAN, ARM, WALK, STOP, DEEPER, SHALLOWER, QUIT = "dead-man", "arm", "walk", "stop", "deeper", "shallower", "quit"
DEVICE_KEYS = {  # of a gamepad, or of a keyboard
    "BTN_TR": DEAD_MAN, "BTN_START": ARM, "BTN_SOUTH": WALK, "BTN_EAST": STOP, "ABS_HAT0Y+": DEEPER,
    "ABS_HAT0Y-": SHALLOWER, "BTN_DPAD_DOWN": DEEPER, "BTN_DPAD_UP": SHALLOWER,
    "KEY_SPACE": DEAD_MAN, "KEY_A": ARM, "KEY_W": WALK, "KEY_S": STOP, "KEY_DOWN": DEEPER, "KEY_UP": SHALLOWER,
    "KEY_Q": QUIT,
}  # fmt: skip
TERMINAL_KEYS = {
    b" ": DEAD_MAN, b"a": ARM, b"w": WALK, b"s": STOP, b"\x1b[B": DEEPER, b"\x1b[A": SHALLOWER,
    b"\x1bOB": DEEPER, b"\x1bOA": SHALLOWER, b"q": QUIT,
}  # fmt: skip


class Controls(NamedTuple):
    held: bool  # the dead-man
    pressed: frozenset[str] = frozenset()


Pad: TypeAlias = Callable[[float], Controls]  # of the time; it raises OSError where the device is gone


def device_pad(keys: InputKeys) -> Pad:
    def read(now_s: float) -> Controls:
        pressed = frozenset(DEVICE_KEYS[name] for name in keys.pressed())
        return Controls(DEAD_MAN in pressed, pressed)

    return read


class TerminalPad:
    """Counts the dead-man as held for as long as any of the keys repeats."""

    def __init__(self, read: Callable[[], bytes]) -> None:
        self._read = read
        self._key = b""
        self._until_s = self._key_s = float("-inf")

    def __call__(self, now_s: float) -> Controls:
        keys = list(split_keys(self._read()))
        for key in keys:
            repeats = key == self._key and now_s - self._key_s <= FIRST_REPEAT_S
            self._until_s = now_s + (REPEAT_S if repeats else FIRST_REPEAT_S)
            self._key, self._key_s = key, now_s
        return Controls(now_s <= self._until_s, frozenset(TERMINAL_KEYS[key] for key in keys))


def split_keys(data: bytes) -> Iterator[bytes]:
    """Yield the known keys among the bytes of a terminal."""
    while data:
        key = next((key for key in TERMINAL_KEYS if data.startswith(key)), b"")
        yield from [key] * bool(key)
        data = data[len(key) or 1 :]


@contextmanager
def terminal_pad() -> Iterator[TerminalPad]:
    """Read keys of standard input without waiting for a whole line. Raises OSError where it is no terminal."""
    try:
        number = sys.stdin.fileno()
        before = termios.tcgetattr(number)
    except (OSError, termios.error) as problem:
        raise OSError("standard input is no terminal: drive with a gamepad, or from a terminal") from problem
    try:
        tty.setcbreak(number)
        yield TerminalPad(lambda: _read_available(number))
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)


def _read_available(number: int) -> bytes:
    if not select.select([number], [], [], 0.0)[0]:
        return b""
    if data := os.read(number, 4096):
        return data
    raise OSError("the terminal is gone")
