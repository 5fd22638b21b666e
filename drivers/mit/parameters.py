"""The configuration of one drive in MIT mode."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

from control.bounds import Bounds, Meaning
from drivers.drive import DriveParameters, is_date
from drivers.mit.models import MODELS, Model

LARGEST_ID = 15  # an answer has four bits for it
AS_DELIVERED = -1.0
DRIVEN_FRACTION = 0.9  # of the range of the velocity, which makers choose as the speed at which the voltage is used up
SMALLEST_RAD_S, LARGEST_RAD_S = 1.0, 500.0  # the 12 bits of a velocity then have steps of 0.5 mrad/s to 0.24 rad/s


@dataclass(frozen=True)
class ProvenWatchdog:
    """What the bench has proven of a drive that cannot report its watchdog, and of which drive."""

    watchdog_s: Annotated[
        float, Bounds(0.0, 10.0), Meaning("silence after which its torque was gone; 0: not proven")
    ] = 0.0
    bus: Annotated[str, Meaning("of the drive that was tried")] = ""
    node_id: Annotated[int, Bounds(0, 127), Meaning("of the drive that was tried", "id")] = 0
    model: Annotated[str, Meaning("of the drive that was tried")] = ""
    date: Annotated[str, Meaning("of the trial, such as 2026-11-24")] = ""


@dataclass(frozen=True)
class MitParameters(DriveParameters):
    node_id: Annotated[int, Bounds(1, LARGEST_ID), Meaning("on that bus", "id")] = 1
    type: Annotated[str, Meaning("the protocol that the drive speaks")] = "mit"
    model: Annotated[str, Meaning("of the motor, whose ranges the codes have, such as AK80-9 or DM4310")] = "DM4310"
    velocity_range_rad_s: Annotated[
        float, Bounds(AS_DELIVERED, LARGEST_RAD_S), Meaning("of the drive's firmware, register VMAX; -1: as delivered")
    ] = AS_DELIVERED
    torque_range_nm: Annotated[float, Bounds(0.0, 500.0), Meaning("register TMAX of a Damiao; 0: as delivered")] = 0.0
    reported_constant_nm_a: Annotated[
        float, Bounds(0.001, 10.0), Meaning("by which its answers state torque: current is that torque divided by it")
    ] = 0.083

    proven_watchdog: ProvenWatchdog = ProvenWatchdog()

    models: ClassVar[tuple[str, ...]] = tuple(MODELS)
    serial_digits: ClassVar[int] = 8
    answers_only: ClassVar[bool] = True

    @cached_property
    def ranges(self) -> Model:
        """The ranges of the codes; raises KeyError for an unknown model, which the checks have refused."""
        return MODELS[self.model].with_ranges(self.velocity_range_rad_s, self.torque_range_nm)

    @property
    def asking_ends_torque(self) -> bool:
        return True

    @property
    def fastest_rad_s(self) -> float:
        return DRIVEN_FRACTION * self.ranges.velocity_rad_s

    @property
    def torque_step_nm(self) -> float:
        return self.ranges.torque_step_nm

    @property
    def reports_settings(self) -> bool:
        return self.ranges.has_registers

    @property
    def knows_watchdog(self) -> bool:
        return self.reports_settings or self.proven_watchdog.watchdog_s > 0.0

    def torque_problems(self, torque_nm: float) -> Iterator[tuple[str, str]]:
        yield from super().torque_problems(torque_nm)
        if self.model not in MODELS:
            yield f"model = {self.model!r}", f"must be one of {', '.join(MODELS)}"
            return
        range_rad_s = self.velocity_range_rad_s
        if range_rad_s != AS_DELIVERED and range_rad_s < SMALLEST_RAD_S:
            bounds = f"{SMALLEST_RAD_S:g} to {LARGEST_RAD_S:g}"
            yield f"velocity_range_rad_s = {range_rad_s:g}", f"must be {bounds}, or -1 for that of the model"
        if self.serial_number and not self.reports_settings:
            yield f"serial_number = {self.serial_number!r}", f"must be empty: that of an {self.model} cannot be read"
        if self.torque_range_nm and not MODELS[self.model].has_registers:
            yield f"torque_range_nm = {self.torque_range_nm:g}", f"must be 0: that of an {self.model} is fixed"
        elif self.ranges.torque_nm < torque_nm:
            key = "torque_range_nm" if self.torque_range_nm else "model"
            value = f"{self.torque_range_nm:g}" if self.torque_range_nm else f"{self.model!r}"
            reason = f"its codes end at {self.ranges.torque_nm:g} N·m, and limits.torque_nm = {torque_nm}"
            yield f"{key} = {value}", reason

    def record_problems(self) -> Iterator[tuple[str, str]]:
        yield from super().record_problems()
        proof = self.proven_watchdog
        if proof.date and not is_date(proof.date):
            yield f"proven_watchdog.date = {proof.date!r}", "must be a date such as 2026-11-24"
            return
        if not proof.watchdog_s or self.model not in MODELS:
            return
        if self.reports_settings:
            yield f"proven_watchdog.watchdog_s = {proof.watchdog_s:g}", f"must be 0: a {self.model} reports its own"
            return
        for key in ("bus", "node_id", "model"):
            proven, own = getattr(proof, key), getattr(self, key)
            if proven != own:
                yield f"proven_watchdog.{key} = {proven!r}", f"must be {own!r}: it is a proof of another drive"
        if not proof.date:
            yield "proven_watchdog.date = ''", "must be the date of the trial"
        elif proof.date < self.firmware_date:
            earliest = f"must be at least firmware_date = {self.firmware_date}"
            yield f"proven_watchdog.date = {proof.date}", f"{earliest}: the trial was of older firmware; repeat it"
