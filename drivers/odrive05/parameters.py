"""The configuration of one ODrive with firmware 0.5: the keys of 0.6, and what this firmware does not report."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar

from control.bounds import Bounds, Meaning
from drivers.odrive.parameters import OdriveParameters


@dataclass(frozen=True)
class Odrive05Parameters(OdriveParameters):
    type: Annotated[str, Meaning("the protocol that the drive speaks")] = "odrive05"
    encoder_counts: Annotated[
        int, Bounds(16, 16777216), Meaning("of one turn, as encoder.config.cpr of the drive", "counts")
    ] = 8192  # its default
    encoder_direction: Annotated[
        int, Bounds(-1, 1), Meaning("as encoder.config.direction of the drive: inverts the reported current", "±1")
    ] = 1  # 0 is refused
    watchdog_s: Annotated[float, Bounds(0.05, 1.0), Meaning("its time-out, as set on the drive")] = 0.1

    serial_digits: ClassVar[int] = 0  # the drive does not report it over CAN
    unreported: ClassVar[frozenset[str]] = frozenset({"temperature"})
    holds_idle_current: ClassVar[bool] = True

    @property
    def current_sign(self) -> int:
        return self.encoder_direction

    def torque_problems(self, torque_nm: float) -> Iterator[tuple[str, str]]:
        if self.encoder_direction == 0:
            yield "encoder_direction = 0", "must be 1 or -1"
        yield from super().torque_problems(torque_nm)
