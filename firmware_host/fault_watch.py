"""All faults that a tick can show: those of the drives, and those that the loop sees of itself and of its buses.

Each is data, the first one found counts; the modes decide what comes of it.
"""

from __future__ import annotations

from control.faults import Fault, find_fault
from control.limits import LimitedTorques
from control.modes import MOVING, Mode
from control.records import JOINTS, DriveStates
from drivers.odrive_codec import error_text
from drivers.odrive_drives import OdriveDrives
from firmware_host.configuration import Configuration
from firmware_host.ticker import PERIOD_S, Beat

ARMING_S = 2.0  # a drive that takes longer to go into closed loop does not mean to
REFUSED_TICKS = 5  # in a row, in each of which one bus lost a command
FIRMWARE = (0, 6)  # major and minor version whose messages the codec knows


class FaultWatch:
    """Owns the counts of ticks in a row in which a bus lost commands."""

    def __init__(self, configuration: Configuration, drives: OdriveDrives) -> None:
        self._configuration = configuration
        self._ranges = configuration.joint_ranges
        self._drives = drives
        self._failed_sends = dict.fromkeys(drives.ports, 0)
        self._refused_ticks = dict.fromkeys(drives.ports, 0)

    def update(
        self, beat: Beat, mode: Mode, mode_since_s: float, states: DriveStates, sent: LimitedTorques
    ) -> Fault | None:
        """Once a tick, before the mode changes; `sent` is what the last tick commanded."""
        self._count_refused()
        return (
            self._of_the_loop(beat, sent)
            or self._of_arming(beat.now_s, mode, mode_since_s, states)
            or self._of_the_drives(beat.now_s, mode, states)
            or self._of_the_firmware()
        )

    def _count_refused(self) -> None:
        for name, port in self._drives.ports.items():
            lost = port.failed_sends > self._failed_sends[name]
            self._refused_ticks[name] = self._refused_ticks[name] + 1 if lost else 0
            self._failed_sends[name] = port.failed_sends

    def _of_the_loop(self, beat: Beat, sent: LimitedTorques) -> Fault | None:
        if not sent.finite:
            return Fault("not_finite", "A torque was not a finite number: this is a bug, please report it.")
        if beat.missed * PERIOD_S > self._configuration.loop.silence_s:
            return Fault("loop_stalled", f"The loop stood still for {1e3 * beat.late_s:.0f} ms.")
        for name, refused_ticks in self._refused_ticks.items():
            if refused_ticks >= REFUSED_TICKS:
                why = self._drives.ports[name].last_send_error
                return Fault("bus_refuses", f"The {name} bus lost commands in {refused_ticks} ticks in a row: {why}.")
        return None

    def _of_arming(self, now_s: float, mode: Mode, mode_since_s: float, states: DriveStates) -> Fault | None:
        if mode is not Mode.ARMING or now_s - mode_since_s <= ARMING_S:
            return None
        slow = [joint for joint, state in zip(JOINTS, states, strict=True) if not state.closed_loop]
        return Fault("arming", f"Not every drive went into closed loop: {', '.join(slow)}.")

    def _of_the_drives(self, now_s: float, mode: Mode, states: DriveStates) -> Fault | None:
        limits, silence_s = self._configuration.limits, self._configuration.loop.silence_s
        fault = find_fault(states, self._ranges, limits, silence_s, mode in MOVING, now_s)
        if fault and fault.name in ("drive_error", "drive_disarmed"):
            return fault._replace(sentence=f"{fault.sentence} {self._drives_say()}".rstrip())
        return fault

    def _drives_say(self) -> str:
        said = [
            f"{axis.joint}: {error_text(axis.state.error_flags | axis.disarm_reason)}"
            for axis in self._drives.axes
            if axis.state.error_flags | axis.disarm_reason
        ]
        return f"({'; '.join(said)})" if said else ""

    def _of_the_firmware(self) -> Fault | None:
        """Asked for once every drive was heard; messages mean other things in other firmware."""
        for axis in self._drives.axes:
            if axis.version is None:
                return Fault("drive_version", f"The {axis.joint} drive did not tell its firmware version yet.")
            if (axis.version.major, axis.version.minor) != FIRMWARE:
                version = ".".join(map(str, axis.version))
                return Fault("drive_version", f"The {axis.joint} drive runs firmware {version}; 0.6 is supported.")
        return None
