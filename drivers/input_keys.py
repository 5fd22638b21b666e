"""Reads which keys, buttons and directions of an input device are pressed, by the kernel's names: KEY_ESC, BTN_SOUTH.

ABS_HAT0Y- and ABS_HAT0Y+ are the two directions of an axis, such as up and down of a gamepad's cross. The package
`evdev` is needed only where an input device is used.
"""

from collections.abc import Iterable


class InputKeys:
    """Owns an opened input device."""

    def __init__(self, device: str, names: Iterable[str]) -> None:
        """Look for these names on the device. Raises ImportError without evdev, and OSError."""
        import evdev

        try:
            self._device = evdev.InputDevice(device)
        except OSError as problem:
            raise OSError(problem.errno, f"is no input device ({problem.strerror})", device) from problem
        self.name = f"{self._device.name} ({device})"
        numbers, has = evdev.ecodes.ecodes, self._device.capabilities(absinfo=False)
        keys, axes = (has.get(kind, []) for kind in (evdev.ecodes.EV_KEY, evdev.ecodes.EV_ABS))
        self.keys = {name: numbers[name] for name in names if numbers.get(name) in keys}
        self._axes = {
            name: numbers[name[:-1]] for name in names if name.startswith("ABS") and numbers.get(name[:-1]) in axes
        }

    def pressed(self) -> set[str]:
        """Return the names that are pressed now. Raises OSError where the device is gone."""
        try:
            active = self._device.active_keys()
            directions = {name: self._device.absinfo(axis).value for name, axis in self._axes.items()}
        except SystemError as problem:  # evdev raises it for a device that was unplugged
            raise OSError(f"{self.name} is gone") from problem
        keys = {name for name, code in self.keys.items() if code in active}
        return keys | {name for name, value in directions.items() if value * int(f"{name[-1]}1") > 0}


def find_devices(name: str) -> list[str]:
    """Return the paths of the input devices that have this key. Raises ImportError without evdev."""
    import evdev

    return [path for path in evdev.list_devices() if InputKeys(path, [name]).keys]
