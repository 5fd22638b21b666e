"""The configuration of one ODrive with firmware 0.6, whose keys firmware 0.5 has as well."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import Annotated

from control.bounds import Bounds, Meaning
from drivers.drive import DriveParameters


@dataclass(frozen=True)
class OdriveParameters(DriveParameters):
    velocity_limit_turn_s: Annotated[
        float, Bounds(0.1, 200.0), Meaning("of the drive; together with the gain it also limits torque")
    ] = 4.0
    velocity_gain_nm_s_turn: Annotated[
        float, Bounds(0.01, 20.0), Meaning("with which the drive cuts torque near the velocity limit")
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
