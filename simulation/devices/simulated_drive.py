"""A simulated motor drive with its motor and encoder: what is alike for every protocol on the bus.

Between the drive and the joint lie imperfections that no drive reports, each off at 0. The motor's true torque constant
differs from the drive's value, and an error of its commutation weakens or inverts the torque; current follows its
command with a first-order lag; magnets pull towards detents at any current. The encoder has steps, noise and an offset,
and may freeze or slip; the speed may slip with it, or be reported in another range; the current has noise. Messages
arrive in order, late by uniformly drawn times, and some repeat their old values.

Cogging is the torque of a motor's magnets, which pull the rotor towards detents at any current. It is the slope of an
energy that repeats n times a turn, so over a turn it does no work. It is no pure sine:

    τ = -A [sin(n θ + φ) + 0.25 sin(2 (n θ + φ))]         the second harmonic is an assumption
"""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from math import cos, exp, isnan, nan, pi, radians, sin
from random import Random

from control.records import NEVER_S
from drivers.can.frames import Frame
from simulation.devices.drive import DriveError, Forgery, SimulatedDriveParameters

TURN_RAD = 2.0 * pi
SECOND_HARMONIC = 0.25
SUPPLY_FRACTION = 0.1


class SimulatedDrive(ABC):
    """One drive on the bus, its motor and its encoder.

    Callers use the joint's angles and torques; the motor's, with their sign, stay inside.
    """

    units_per_turn = 1.0  # of the motor's angle: turns, or the radians of a protocol that has them
    boot_s = 0.5  # silence of a drive that restarts
    no_load_rad_s = float("inf")  # the speed at which the motor's voltage is used up and it drives no further

    def __init__(self, parameters: SimulatedDriveParameters, random: Random) -> None:
        self.parameters = parameters
        self._random = random
        self._unit_rad = TURN_RAD / self.units_per_turn
        self.reset(0.0)

    def reset(self, now_s: float) -> None:
        """Restore the state after power-on."""
        self._fed_s = self._stepped_s = now_s
        self._current_a = 0.0  # the motor's
        self._angle = self._speed = self._reported_angle = 0.0  # of the motor
        self.slipped_rad = 0.0  # of the encoder, and there it stays
        self._boots_until_s = self._next_due_s = NEVER_S
        self._forged_a = nan  # the current that the next answer reports
        self._given: list[Frame] = []  # answers that are still to be sent
        self._repeated: dict[object, bytes] = {}  # the newest values of each kind of message
        self._in_transit: deque[tuple[float, Frame]] = deque()  # late messages: (arrival, frame)

    def restart(self, now_s: float) -> None:
        """Restart as after a supply dip: ignore and send nothing for `boot_s`; the angle stays."""
        angle, speed, slipped_rad = self._angle, self._speed, self.slipped_rad
        self.reset(now_s + self.boot_s)
        self._angle, self._speed, self.slipped_rad, self._stepped_s = angle, speed, slipped_rad, now_s
        self._boots_until_s = now_s + self.boot_s

    @property
    def energised(self) -> bool:
        """Whether it follows torque commands; may be set, as if another program had commanded it."""
        raise NotImplementedError  # mypyc knows no abstract setter

    @energised.setter
    def energised(self, energised: bool) -> None:
        raise NotImplementedError

    @property
    @abstractmethod
    def failed(self) -> bool:
        """Whether the drive has an active error."""

    @abstractmethod
    def trip(self, error: DriveError) -> None:
        """Go idle with an error."""

    @abstractmethod
    def receive(self, frame: Frame, now_s: float) -> list[Frame]:
        """Execute one frame of the bus and return the answers to it that arrive at once."""

    @abstractmethod
    def forge(self, forgery: Forgery) -> Frame:
        """Make a frame for the bus that this drive does not send itself."""

    @abstractmethod
    def forge_current(self, current_a: float) -> Frame:
        """Make a report of another current than the motor has."""

    @abstractmethod
    def forge_torque(self, torque_nm: float) -> Frame:
        """Make a command of a torque of the joint, as another program on the bus sends it."""

    @abstractmethod
    def _motor_nm(self, now_s: float) -> float:
        """Return the motor's torque now, by the drive's own torque constant, and trip where that is due."""

    @property
    def supply_a(self) -> float:
        """Return the current of the supply, roughly: a bridge gives current at a fraction of the voltage."""
        return SUPPLY_FRACTION * abs(self._current_a)

    def measure(self, angle_rad: float, velocity_rad_s: float) -> None:
        """Set the joint's true angle and velocity."""
        parameters, unit_rad = self.parameters, self._unit_rad
        self._angle = parameters.sign * angle_rad / unit_rad + parameters.zero_turn * self.units_per_turn
        self._speed = parameters.sign * velocity_rad_s / unit_rad

    def torque_nm(self, now_s: float) -> float:
        """Return the torque that the motor exerts at the joint now."""
        parameters = self.parameters
        torque_nm = self._motor_nm(now_s) * (1.0 + parameters.torque_constant_error)
        self.slipped_rad += parameters.encoder_slip_rad_s * (now_s - self._stepped_s)
        self._stepped_s = now_s
        if parameters.commutation_error_deg:
            torque_nm *= cos(radians(parameters.commutation_error_deg))
        if parameters.cogging_nm:
            turns = self._angle / self.units_per_turn
            angle = parameters.cogging_per_turn * TURN_RAD * turns + radians(parameters.cogging_phase_deg)
            torque_nm -= parameters.cogging_nm * (sin(angle) + SECOND_HARMONIC * sin(2.0 * angle))
        return parameters.sign * torque_nm

    def cyclic_frames(self, now_s: float) -> Iterable[Frame]:
        """Return the messages that arrive by now."""
        frames = self._due_frames(now_s) if now_s >= self._next_due_s else ()
        return self._delayed(frames, now_s) if self._is_late else frames

    @property
    def _is_late(self) -> bool:
        """Return whether messages are late, or follow such that have not arrived yet."""
        return bool(self.parameters.message_delay_s or self._in_transit or self._given)

    def _delayed(self, frames: Iterable[Frame], now_s: float) -> Iterator[Frame]:
        """Yield the frames that arrive by now, stamped with the time of arrival; none overtakes another."""
        for frame in frames:
            arrival_s = now_s + self.parameters.message_delay_s * self._random.random()
            if self._in_transit:
                arrival_s = max(arrival_s, self._in_transit[-1][0])
            self._in_transit.append((arrival_s, frame))
        while self._in_transit and self._in_transit[0][0] <= now_s:
            yield self._in_transit.popleft()[1]._replace(stamp_s=now_s)

    def _due_frames(self, now_s: float) -> Iterable[Frame]:
        """Return the messages that are sent now: here the answers that are late."""
        given, self._given = self._given, []
        return given

    def _send(self, answer: Frame) -> list[Frame]:
        """Return an answer that arrives at once; a late one becomes one of the cyclic frames."""
        if not self._is_late:
            return [answer]
        self._given.append(answer)
        return []

    def _new_or_repeated(self, message: object, encode: Callable[[], bytes]) -> bytes:
        """Return the values of a message; in a fraction of all, at random, they are those of the one before."""
        fraction = self.parameters.repeated_fraction
        if not fraction:
            self._repeated.clear()
            return encode()
        if message not in self._repeated or self._random.random() >= fraction:
            self._repeated[message] = encode()
        return self._repeated[message]

    def _lagged_nm(self, torque_nm: float, before_nm: float, now_s: float) -> float:
        return torque_nm + (before_nm - torque_nm) * exp((self._stepped_s - now_s) / self.parameters.current_lag_s)

    def _noise(self, deviation: float) -> float:
        return self._random.gauss(0.0, deviation) if deviation else 0.0

    def _measured_a(self) -> float:
        """Return the reported current: a forged one once, or the motor's with noise."""
        forged_a, self._forged_a = self._forged_a, nan
        return self._current_a + self._noise(self.parameters.current_noise_a) if isnan(forged_a) else forged_a

    def _measured_angle(self) -> float:
        parameters, units_per_turn = self.parameters, self.units_per_turn
        if not parameters.encoder_frozen:
            error_rad = parameters.encoder_offset_rad + self.slipped_rad
            if parameters.encoder_noise_rad:
                error_rad += self._random.gauss(0.0, parameters.encoder_noise_rad)
            turns = self._angle / units_per_turn + parameters.sign * error_rad / TURN_RAD
            steps = round(turns * parameters.encoder_counts)
            self._reported_angle = steps / parameters.encoder_counts * units_per_turn
        return self._reported_angle

    def _measured_speed(self) -> float:
        parameters = self.parameters
        if parameters.encoder_frozen:
            return 0.0
        slip = parameters.sign * parameters.velocity_slip_rad_s / self._unit_rad
        speed = (self._speed + slip) * (1.0 + parameters.velocity_error)
        noise_rad_s = parameters.velocity_noise_rad_s
        return speed + self._random.gauss(0.0, noise_rad_s) / self._unit_rad if noise_rad_s else speed
