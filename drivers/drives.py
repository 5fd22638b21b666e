"""The robot's drives on its CAN ports, as joints: of one protocol or of several, each described by its DriveType.

`read` drains the ports and stores the newest value of every signal with the time when it arrived. `send` commands
torque, through the gate (drivers/transmit_gate.py) like everything that leaves. Nothing is transmitted unless the
caller asks for it. Frames of unknown ids and malformed frames are counted and ignored.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain

from control.records import NEVER_S, DriveStates, Joints, Torques
from drivers.can.can_port import CanPort
from drivers.can.frames import EXTENDED_MASK, STANDARD_MASK, MalformedMessageError
from drivers.drive import FD, DriveHealth
from drivers.drive_axis import DriveAxis
from drivers.transmit_gate import TransmitGate

SUPPLY_TICKS = 10  # between questions for a supply, one drive after the other: 38 a second are 1 % of a bus at most
REPEAT_S = 0.1  # between two requests to change the state of a drive; its next report has the result
LONGEST_IN_QUEUE_S = 2.0  # an older stamp belongs to another clock


class Drives:
    """The drives of all joints, on one bus or several."""

    def __init__(
        self,
        axes: Sequence[DriveAxis],
        ports: Mapping[str, CanPort],
        gate: TransmitGate,
        others: Mapping[str, Mapping[int, tuple[str, str]]] | None = None,
    ) -> None:
        """Join the axes with the ports.

        `others`: by bus and arbitration id of a frame that only another type of drive sends, the joint that has its
        node id, and that type.
        """
        self.ports = dict(ports)  # by the name of the bus
        self.gate = gate
        self.axes = tuple(axes)  # in the order of the rig
        self._axis_of = {axis.joint: axis for axis in self.axes}
        self._other_protocols: dict[str, str] = {}  # of the joints under whose id another type of drive answers
        self._receivers: list[tuple[CanPort, dict[int, Callable[[bytes, float], None]]]] = []
        for name, port in self.ports.items():
            tables = (axis.receivers.items() for axis in self.axes if axis.parameters.bus == name)
            own: dict[int, Callable[[bytes, float], None]] = {}
            for key, receive in chain.from_iterable(tables):
                own[key] = partial(_both, own[key], receive) if key in own else receive
            foreign = {key: partial(self._on_other, *other) for key, other in (others or {}).get(name, {}).items()}
            self._receivers.append((port, foreign | own))
            port.listen_to(key & EXTENDED_MASK for key in self._receivers[-1][1])
        self.reset()

    def _on_other(self, joint: str, protocol: str, data: bytes, now_s: float) -> None:
        """Handle a frame that only a drive of another type sends."""
        self._other_protocols[joint] = protocol
        self.unknown_frames += 1

    def reset(self) -> None:
        self._other_protocols.clear()
        for axis in self.axes:
            axis.reset()
        self.gate.close()
        self.unknown_frames = 0  # of other ids or another kind, where the port does not keep them away
        self.malformed_frames = 0  # of these drives, with a payload that cannot be decoded
        self._armed_s = self._disarmed_s = NEVER_S
        self._lost_before = self._lost
        self._supply_tick = 0
        self._idling_lost = False  # the bus refused a command to idle, even if the drives report idle

    def poll(self) -> None:
        """Ask the drives for what they report only when asked. `send` asks them as well."""
        for axis in self.axes:
            axis.poll()

    def read(self, now_s: float) -> DriveStates:
        """Read all frames that have arrived; return the newest of every signal."""
        for axis in self.axes:
            axis.begin_read(now_s)
        for port, receivers in self._receivers:
            for frame in port.receive():
                identifier, data, is_remote, is_error, is_extended, stamp_s, is_fd, _ = frame
                receive = receivers.get(identifier | FD if is_fd else identifier)
                if receive is None or is_remote or is_error or is_extended is not (identifier > STANDARD_MASK):
                    self.unknown_frames += 1
                    continue
                if not 0.0 <= now_s - stamp_s < LONGEST_IN_QUEUE_S:  # the port does not know, or uses another clock
                    stamp_s = now_s
                try:
                    receive(data, stamp_s)
                except MalformedMessageError:
                    self.malformed_frames += 1
        return Joints(*[axis.state for axis in self.axes])

    @property
    def _lost(self) -> int:
        return sum([port.failed_sends for port in self.ports.values()])

    @property
    def heard(self) -> bool:
        """Return whether every drive has sent every signal that control depends on at least once."""
        return all(axis.state.heard for axis in self.axes)

    @property
    def health(self) -> Joints[DriveHealth]:
        health = Joints(*[axis.health for axis in self.axes])
        if not self._other_protocols:
            return health
        others = self._other_protocols
        return health.map(lambda each: each._replace(other_protocol=others.get(each.joint, "")))

    @property
    def refused_commands(self) -> int:
        """Commands that the gate has refused since the start."""
        return self.gate.refused

    @property
    def last_refusal(self) -> str:
        return self.gate.last_refusal

    def send(self, torques_nm: Torques, elapsed_s: float) -> None:
        """Command all torques. They may differ from the ones before by the slew rate times `elapsed_s`."""
        self.gate.allow_step(elapsed_s)
        for axis, torque_nm in zip(self.axes, torques_nm, strict=True):
            axis.send_torque(torque_nm)
        lost = self._lost
        if lost != self._lost_before:
            self._lost_before = lost
            for axis in self.axes:
                axis.forget_commands()

    def send_torque(self, joint: str, torque_nm: float) -> None:
        """Command one joint alone, within the step that the last `send` allowed."""
        self._axis_of[joint].send_torque(torque_nm)

    def arm(self, now_s: float, at_once: bool = False) -> None:
        """Open the gate and prepare all drives `at_once`; later ask the others for closed loop, every REPEAT_S.

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
        """Close the gate; commands zero torque and idle `at_once`, later every REPEAT_S.

        Later it commands the drives that may still be in closed loop, and all where the bus refused the last command.
        """
        self.gate.close()
        if not at_once and now_s - self._disarmed_s < REPEAT_S:
            return
        lost_before, everyone = self._lost, at_once or self._idling_lost
        for axis in self.axes:
            if everyone or axis.may_be_on:
                self._disarmed_s = now_s
                axis.disarm()
        self._idling_lost = self._lost > lost_before

    def force_idle(self, repeats: int) -> None:
        """Command zero torque and idle to every drive, `repeats` times. Never raises."""
        self.gate.close()
        for axis in self.axes * repeats:
            with suppress(Exception):  # one bus may be what broke; the others' drives still have to receive it
                axis.disarm()

    def clear_errors(self) -> None:
        for axis in self.axes:
            axis.clear_errors()

    def request_settings(self, now_s: float) -> None:
        """Ask for firmware, watchdog and other settings, now and then: a restart forgets them, and they may change."""
        for axis in self.axes:
            axis.request_settings(now_s)

    def request_supply(self) -> None:
        """Ask the drives in turn for their supply. It is called in every tick."""
        self._supply_tick += 1
        turn, rest = divmod(self._supply_tick, SUPPLY_TICKS)
        if not rest:
            self.axes[turn % len(self.axes)].request_supply()

    def close(self) -> None:
        for port in self.ports.values():
            port.close()


def _both(
    first: Callable[[bytes, float], None], second: Callable[[bytes, float], None], data: bytes, now_s: float
) -> None:
    """Handle what arrives under an id that drives share; each finds its own frames by their payload."""
    first(data, now_s)
    second(data, now_s)
