"""The transmit gate between a port and a mock bus, and the frames of every protocol for it, byte by byte."""

from collections.abc import Callable, Iterable, Sequence
from struct import pack
from typing import NamedTuple

from control.parameters.joint_limits import JointLimits
from drivers.can.frames import Frame
from drivers.can.mock_bus import MockBus
from drivers.mit import codec as mit
from drivers.mit import gate_table as mit_table
from drivers.mit.models import MODELS
from drivers.mit.parameters import MitParameters
from drivers.mit.settings import REGISTERS
from drivers.moteus import codec as moteus
from drivers.moteus import gate_table as moteus_table
from drivers.moteus import registers
from drivers.moteus.parameters import MoteusParameters
from drivers.moteus.settings import IDENTITY, POLL, QUESTIONS
from drivers.odrive import gate_table as odrive_table
from drivers.odrive.parameters import OdriveParameters
from drivers.odrive05 import gate_table as odrive05_table
from drivers.odrive05.parameters import Odrive05Parameters
from drivers.transmit_gate import GateTable, TransmitGate

LIMITS = JointLimits(torque_nm=0.75, torque_rate_nm_s=100.0)
STEP_S = 0.002  # so that a step is 0.2 N·m
NODE, OTHER_NODE = 2, 3
ZERO, IDLE, CLOSED_LOOP = bytes(4), b"\1\0\0\0", b"\x08\0\0\0"
TORQUE_MODE = bytes.fromhex("01000000 01000000")
CONFIGURED = bytes.fromhex("00000041 0000c040")  # 8 turns/s, 6 A


class Protocol(NamedTuple):
    """What one node of a protocol may be sent; `torque` encodes a torque."""

    table: GateTable
    torque: Callable[[float], bytes]
    always: Sequence[Frame]  # may leave open or closed
    while_open: Sequence[Frame]
    never: Sequence[Frame]  # under other ids than that of the torque: nothing leaves
    no_torque: Sequence[bytes]  # under the id of the torque: replaced by zero torque, or by `idle` while closed
    idle: bytes = b""

    def torque_frame(self, data: bytes) -> Frame:
        return Frame(self.table.torque_id, data, **self.table.kind._asdict())


def odrive(node: int = NODE) -> Protocol:
    drive = OdriveParameters("left", node, velocity_limit_turn_s=8.0, current_limit_a=6.0)
    return Protocol(
        table=odrive_table.gate_table(drive),
        torque=lambda torque_nm: pack("<f", torque_nm),
        always=frames(node, *ALWAYS_OF_ODRIVE, "18#00", "04#00c80100", "06#R"),
        while_open=frames(node, "07#08000000"),
        never=frames(
            node,
            *NEVER_OF_ODRIVE,
            "18#01",
            "18#",
            "04#01c80100",  # writes
            "04#00c80101",
            "04#00c801",
            "04#00c8010000",
            "04#R",
            "09#R",
        ),
        no_torque=[b"", bytes(3), bytes(5), bytes(8)],
    )


def odrive05(node: int = NODE) -> Protocol:
    drive = Odrive05Parameters("left", node, velocity_limit_turn_s=8.0, current_limit_a=6.0)
    return odrive(node)._replace(
        table=odrive05_table.gate_table(drive),
        always=frames(node, *ALWAYS_OF_ODRIVE, "18#", "0a#R"),
        never=frames(
            node,
            *NEVER_OF_ODRIVE,
            "18#00",  # as firmware 0.6 is asked
            "06#R",  # 0.6 is asked for its serial number so; 0.5 would take a new node id
            "06#03000000",
            "04#00c80100",  # 0.6 is asked for a parameter so
            "16#R",  # reboots as well
            "0a#",  # a request as well, but not of this program's form
            "03#R",
            "10#",  # calibration of cogging
        ),
    )


ALWAYS_OF_ODRIVE = (
    "07#01000000",  # idle
    "0b#0100000001000000",  # torque mode
    "0f#000000410000c040",  # 8 turns/s, 6 A
    "1b#0000003f00000000",  # 0.5 N·m per turn/s, no integrator
    "0e#00000000",
    "0e#00000080",  # minus zero
    "00#R",
)
NEVER_OF_ODRIVE = (
    "0c#0000000000000000",  # position
    "0d#0000000000000000",  # velocity
    "02#",  # emergency stop: not used
    "16#00",  # reboot
    "1f#",  # firmware update
    "19#00000000",  # a new angle
    "07#03000000",  # calibration
    "07#01",
    "07#0100000000",
    "07#R",
    "0b#0300000001000000",  # position control
    "0b#0100000006000000",  # torque ramp
    "0b#08000000",
    "0f#010000410000c040",  # the least bit more than 8 turns/s
    "0f#000000410100c040",
    "0f#000000410000c04000",
    "1b#0000003f0000803f",  # an integrator
    "1b#0000803f00000000",
    "0e#R",
    "00#",
    "00#R00",
)


def frames(node: int, *texts: str) -> list[Frame]:
    """Return frames in the notation of cansend, with a command of CANSimple in place of the id."""
    parts = [text.partition("#") for text in texts]
    return [
        Frame(node << 5 | int(command, 16), bytes.fromhex(data.removeprefix("R")), is_remote=data.startswith("R"))
        for command, _, data in parts
    ]


def of_moteus(node: int = NODE) -> Protocol:
    console = [b"d stop\n", b"conf set servo.default_timeout_s nan\n", b"conf write\n"]
    return Protocol(
        table=moteus_table.gate_table(MoteusParameters("left", node)),
        torque=moteus.encode_torque,
        always=[
            moteus.command_frame(node, data)
            for data in (moteus.QUERY_ALONE, moteus.STOP_AND_QUERY, IDENTITY, POLL, *QUESTIONS)
        ],
        while_open=[],
        never=[moteus.command_frame(node, moteus.QUERY_ALONE)._replace(arbitration_id=node)],
        no_torque=[
            b"",
            moteus.STOP,  # without asking
            bytes.fromhex("01000a"),  # position mode with the defaults: kp and kd
            bytes.fromhex("01000f"),
            *(registers.padded(registers.encode_console(registers.CONSOLE_INPUT, text)) for text in console),
            2 * moteus.QUERY_ALONE,
            moteus.encode_torque(0.1) + bytes([registers.NOP]),
        ],
        idle=moteus.QUERY_ALONE,
    )


def damiao(node: int = NODE, model: str = "DM4310") -> Protocol:
    range_nm = MODELS[model].torque_nm
    written = [(kind, register) for kind in (mit.WRITE, mit.STORE) for register in REGISTERS]
    return Protocol(
        table=mit_table.gate_table(MitParameters("left", node, model=model)),
        torque=lambda torque_nm: mit.encode_torque(torque_nm, range_nm),
        always=[
            Frame(node, mit.LEAVE),
            Frame(node, mit.CLEAR),
            *(Frame(mit.REGISTER_ID, mit.encode_read(node, register)) for register in REGISTERS),
        ],
        while_open=[Frame(node, mit.ENTER)],
        never=[Frame(mit.REGISTER_ID, mit.encode_register(node, *each, bytes(4))) for each in written],
        no_torque=[
            b"",
            mit.SET_ZERO,
            bytes.fromhex("fffffffffffffff8"),
            bytes.fromhex("8000800000100800"),  # kd
            bytes.fromhex("8000800100000800"),  # kp
            bytes.fromhex("8000800000001800"),  # kd's lowest bit
            bytes.fromhex("8001800000000800"),  # another position
            bytes.fromhex("8000801000000800"),  # another velocity
            bytes.fromhex("80008000000008"),
            bytes.fromhex("800080000000080000"),
        ],
        idle=mit.LEAVE,
    )


def cubemars(node: int = NODE) -> Protocol:
    """A CubeMars is sent no command that only a Damiao knows."""
    other = damiao(node, "AK80-9")
    return other._replace(
        always=[Frame(node, mit.LEAVE)],
        never=[*other.never, *other.always[2:]],
        no_torque=[*other.no_torque, mit.CLEAR],
    )


def robstride(node: int = NODE) -> Protocol:
    """A RobStride is also asked for its faults, by a frame under the id of its torque."""
    other = damiao(node, "RS05")
    return other._replace(
        always=[Frame(node, mit.LEAVE), Frame(node, mit.CLEAR), Frame(node, mit.FAULT_QUESTION)],
        never=[*other.never, *other.always[2:]],
        no_torque=[*other.no_torque, bytes.fromhex("ffffffffffff01fc"), bytes.fromhex("ffffffffffff00fd")],
    )


PROTOCOLS: dict[str, Callable[[int], Protocol]] = {
    "odrive": odrive,
    "odrive05": odrive05,
    "moteus": of_moteus,
    "damiao": damiao,
    "cubemars": cubemars,
    "robstride": robstride,
}


class GateBench:
    """`port` passes the gate, `far` receives what leaves it. The gate is closed."""

    def __init__(self, tables: Iterable[GateTable], limits: JointLimits = LIMITS, is_open: bool = False) -> None:
        bus = MockBus()
        self.far = bus.open()
        self.gate = TransmitGate(limits)
        self.port = self.gate.outlet(bus.open(), tables)
        self.gate.allow_step(STEP_S)
        if is_open:
            self.gate.open()

    def passed(self, frame: Frame) -> list[Frame]:
        """Send a frame and return what leaves."""
        self.port.send(frame)
        return self.far.receive()
