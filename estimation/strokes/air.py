"""What a flipper's motors show in free air, swing by swing: the friction of the sweep joint, and whether it is air.

The mean friction of a swing is the work of the sweep motor over its travel, with the load's sign (what resists is
negative in a forward swing),

    c = -∫ τ₁ dα / ∫ |dα|

Inertia cancels from rest to rest, gravity over a symmetric swing, and an offset of the current where the swing has both
directions. Dry friction changes its sign with the direction: a zero taken in the forward swing and subtracted in the
backward stance would count it twice. So the load of the stance is corrected by -c, and nothing is subtracted at rest.
The adduction joint has the same motor and, in the authors' logs without mud, the same friction (0.045 where the sweep
has 0.055 N·m, 0.01 in both in other months): its load is corrected by -c on the way down and by +c on the way up.

Mud that is dragged along only adds to c, so the least swing of a trial counts. A swing above AIR_NM is not in the air:
in four of the authors' walks the body has sunk, and the flipper swings through mud with 0.2 to 0.83 N·m.
"""

from math import isfinite

from control.records import UNKNOWN

AIR_NM = 0.15  # twice the largest friction of these motors: 0.05 to 0.07 N·m in the authors' logs without mud
UNKNOWN_FRICTION_NM = 0.05  # std_error before any swing in air: as large as it was in those logs
MEASURED_NM = 0.01  # std_error of a measured friction: the scatter of the first swings in ten of the authors' logs
SHORTEST_RAD = 0.05  # of a swing that counts
MUD_RATIO = 3.0  # of stance torque over friction: in air they are equal
MUD_NM = 0.03  # added to the friction: cogging and noise of a motor that has none


class AirSwing:
    """Owns the friction of one flipper's sweep joint over a trial, and the sums of the swing under way."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self.friction_nm = 0.0
        self.std_error_nm = UNKNOWN_FRICTION_NM
        self.is_air = True  # of the last swing; a trial begins in air
        self._measured = False
        self._begin()

    def _begin(self) -> None:
        """Begin the sums of a swing."""
        self._sweep_rad = self._sweep_nm = UNKNOWN
        self._work_j = self._travel_rad = 0.0

    def update(self, sweep_rad: float, sweep_nm: float) -> None:
        """Add a sample in free air."""
        turn_rad = sweep_rad - self._sweep_rad
        if isfinite(turn_rad):
            self._work_j += turn_rad * (sweep_nm + self._sweep_nm) / 2.0
            self._travel_rad += abs(turn_rad)
        self._sweep_rad, self._sweep_nm = sweep_rad, sweep_nm

    def close(self) -> None:
        """Take the friction from the swing that ends."""
        if self._travel_rad >= SHORTEST_RAD:
            friction_nm = max(0.0, -self._work_j / self._travel_rad)
            self.is_air = friction_nm < AIR_NM
            if self.is_air:
                self.friction_nm = min(friction_nm, self.friction_nm) if self._measured else friction_nm
                self.std_error_nm, self._measured = MEASURED_NM, True
        self._begin()

    @property
    def unknown_nm(self) -> float:
        """The error of a friction that no swing has shown; 0 for a measured one."""
        return 0.0 if self._measured else UNKNOWN_FRICTION_NM

    def is_push(self, stance_nm: float) -> bool:
        """Return whether the sweep torque of a stance, friction included, needs mud to explain it."""
        return stance_nm > MUD_RATIO * (self.friction_nm + MUD_NM)

    def is_dragging(self, stance_nm: float) -> bool:
        """Return whether a stance that is no push takes more than friction: the swing's torque is then mud as well."""
        return stance_nm > AIR_NM

    def is_pull(self, extraction_nm: float) -> bool:
        """Return whether the adduction torque of an extraction, without friction, needs mud that holds on."""
        return extraction_nm > AIR_NM
