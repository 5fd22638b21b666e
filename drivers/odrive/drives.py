"""The robot's four ODrives on one or two CAN ports, as joints.

`read` drains the ports and stores the newest value of every signal with the time when it arrived. `send` commands
torque, through the gate (drivers/transmit_gate.py) like everything that leaves. Nothing is transmitted unless the
caller asks for it. Frames of unknown ids and malformed frames are counted and ignored.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from math import isfinite

from control.limits import JointLimits
from control.records import JOINTS, NEVER_S, DriveStates, Joints, Torques
from drivers.can.can_port import CanPort
from drivers.can.frames import Frame
from drivers.drive import DriveHealth, WatchdogEndpoints
from drivers.odrive.axis import OdriveAxis
from drivers.odrive.codec import MalformedMessageError
from drivers.odrive.gate_tables import gate_table
from drivers.odrive.parameters import OdriveParameters
from drivers.transmit_gate import TransmitGate

REPEAT_S = 0.1  # between two requests to change the axis state; the heartbeat reports the result
LONGEST_IN_QUEUE_S = 2.0  # an older stamp belongs to another clock
REPEAT_UNKNOWN_S = 0.5  # between two requests for a setting that is still unknown
REFRESH_S = 2.0  # between two requests for a known setting, which may be changed over USB


class OdriveDrives:
    """The drives of all joints: a `Drives` of drivers/drive.py."""

    def __init__(
        self,
        parameters: Mapping[str, OdriveParameters],
        ports: Mapping[str, CanPort],
        limits: JointLimits | None = None,
        endpoints: Sequence[WatchdogEndpoints] = (),
    ) -> None:
        self.ports = dict(ports)
        self.gate = TransmitGate(limits or JointLimits())
        outlets = {
            name: self.gate.outlet(port, [gate_table(drive) for drive in parameters.values() if drive.bus == name])
            for name, port in self.ports.items()
        }
        self.axes = tuple(
            OdriveAxis(joint, parameters[joint], outlets[parameters[joint].bus], endpoints) for joint in JOINTS
        )
        self._receivers: list[tuple[CanPort, dict[int, Callable[[bytes, float], None]]]] = []
        for name, port in self.ports.items():
            tables = (axis.receivers.items() for axis in self.axes if axis.parameters.bus == name)
            self._receivers.append((port, dict(chain.from_iterable(tables))))
            port.listen_to(self._receivers[-1][1])
        self.reset()

    def reset(self) -> None:
        for axis in self.axes:
            axis.reset()
        self.gate.close()
        self.unknown_frames = 0  # of other ids, remote or extended, where the port does not keep them away
        self.malformed_frames = 0  # of these drives, with a payload that cannot be decoded
        self._armed_s = self._disarmed_s = NEVER_S
        self._requested_s = {"version": NEVER_S, "watchdog": NEVER_S, "serial": NEVER_S}
        self._lost_before = self._lost
        self._idling_lost = False  # the bus refused a command to idle, whatever the drives report

    def read(self, now_s: float) -> DriveStates:
        for axis in self.axes:
            axis.begin_read(now_s)
        for port, receivers in self._receivers:
            for frame in port.receive():
                receive = None if frame.is_remote or frame.is_extended else receivers.get(frame.arbitration_id)
                if receive is None or frame.is_error:
                    self.unknown_frames += 1
                    continue
                try:
                    receive(frame.data, _stamp_s(frame, now_s))
                except MalformedMessageError:
                    self.malformed_frames += 1
        a, b, c, d = self.axes
        return Joints(a.state, b.state, c.state, d.state)

    @property
    def _lost(self) -> int:
        return sum(port.failed_sends for port in self.ports.values())

    @property
    def heard(self) -> bool:
        return all(axis.state.heard for axis in self.axes)

    @property
    def health(self) -> Joints[DriveHealth]:
        a, b, c, d = self.axes
        return Joints(a.health, b.health, c.health, d.health)

    @property
    def refused_commands(self) -> int:
        return self.gate.refused

    @property
    def last_refusal(self) -> str:
        return self.gate.last_refusal

    def send(self, torques_nm: Torques, elapsed_s: float) -> None:
        self.gate.allow_step(elapsed_s)
        for axis, torque_nm in zip(self.axes, torques_nm, strict=True):
            axis.send_torque(torque_nm)
        lost = self._lost
        if lost != self._lost_before:
            self._lost_before = lost
            for axis in self.axes:
                axis.setpoints.forget_commands()

    def send_torque(self, joint: str, torque_nm: float) -> None:
        self.axes[JOINTS.index(joint)].send_torque(torque_nm)

    def arm(self, now_s: float, at_once: bool = False) -> None:
        """Opens the gate and prepares all drives `at_once`; later asks the others for closed loop, every REPEAT_S.

        A drive is prepared again before it is asked, and none is asked while the bus loses frames.
        """
        self.gate.open()
        if not at_once and now_s - self._armed_s < REPEAT_S:
            return
        self._armed_s = NEVER_S if at_once else now_s
        lost_before = self._lost
        late = [axis for axis in self.axes if at_once or not axis.closed_loop]
        for axis in late:
            axis.prepare()
        if at_once or self._lost > lost_before:
            return
        for axis in late:
            axis.close_loop()

    def disarm(self, now_s: float, at_once: bool = False) -> None:
        """Closes the gate; commands zero torque and idle `at_once`, later every REPEAT_S.

        Later it commands the drives still in closed loop, and all of them where the bus refused the last command.
        """
        self.gate.close()
        if not at_once and now_s - self._disarmed_s < REPEAT_S:
            return
        lost_before, everyone = self._lost, at_once or self._idling_lost
        for axis in self.axes:
            if everyone or axis.closed_loop:
                self._disarmed_s = now_s
                axis.disarm()
        self._idling_lost = self._lost > lost_before

    def force_idle(self, repeats: int) -> None:
        self.gate.close()
        for axis in self.axes * repeats:
            with suppress(Exception):  # one bus may be what broke; the others' drives still have to receive it
                axis.disarm()

    def clear_errors(self) -> None:
        for axis in self.axes:
            axis.clear_errors()

    def request_settings(self, now_s: float) -> None:
        self._request(now_s, "version", lambda axis: axis.settings.version is not None, OdriveAxis.request_version)
        self._request(now_s, "watchdog", lambda axis: isfinite(axis.settings.watchdog_s), OdriveAxis.request_watchdog)
        self._request(now_s, "serial", lambda axis: axis.settings.identified, OdriveAxis.request_serial_number)

    def _request(
        self, now_s: float, setting: str, is_known: Callable[[OdriveAxis], bool], request: Callable[[OdriveAxis], None]
    ) -> None:
        """Asks the drives with the setting unknown every REPEAT_UNKNOWN_S, and all every REFRESH_S once it is known."""
        unknown = [axis for axis in self.axes if not is_known(axis)]
        if now_s - self._requested_s[setting] < (REPEAT_UNKNOWN_S if unknown else REFRESH_S):
            return
        self._requested_s[setting] = now_s
        for axis in unknown or self.axes:
            request(axis)

    def close(self) -> None:
        for port in self.ports.values():
            port.close()


def _stamp_s(frame: Frame, now_s: float) -> float:
    """Returns when a frame was on the bus; now where its port does not know, or uses another clock."""
    return frame.stamp_s if 0.0 <= now_s - frame.stamp_s < LONGEST_IN_QUEUE_S else now_s
