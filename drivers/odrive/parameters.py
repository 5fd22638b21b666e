"""The configuration of one ODrive: of any firmware, and what firmware 0.5 needs besides."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import Annotated, ClassVar

from control.bounds import Bounds, Meaning
from drivers.drive import DriveParameters


@dataclass(frozen=True)
class OdriveParameters(DriveParameters):
    velocity_limit_turn_s: Annotated[
        float, Bounds(0.1, 200.0), Meaning("of the drive; together with the gain it also limits torque")
    ] = 4.0
    velocity_gain_nm_s_turn: Annotated[
        float, Bounds(0.01, 20.0), Meaning("with which the drive cuts torque above the velocity limit")
    ] = 0.5

    @property
    def current_sign(self) -> int:
        """The sign of the reported currents, compared with torque and position."""
        return 1

    def torque_problems(self, torque_nm: float) -> Iterator[tuple[str, str]]:
        """The drive clamps torque to its velocity limit times the gain without reporting it."""
        if self.velocity_limit_turn_s * self.velocity_gain_nm_s_turn < torque_nm:
            needed = ceil(100.0 * torque_nm / self.velocity_limit_turn_s) / 100.0
            yield (
                f"velocity_gain_nm_s_turn = {self.velocity_gain_nm_s_turn}",
                f"must be at least {needed:.2f}, or with velocity_limit_turn_s = {self.velocity_limit_turn_s}"
                f" the drive gives less than limits.torque_nm = {torque_nm}",
            )
        yield from super().torque_problems(torque_nm)


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
