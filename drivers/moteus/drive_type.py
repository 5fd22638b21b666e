"""moteus as a drive type: its parameters, its axis, and how to read and forge its frames without commanding one."""

from collections.abc import Mapping
from contextlib import suppress

from control.rate import RATE_HZ
from drivers.can.bus_load import FrameRate
from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import FD, DriveParameters
from drivers.drive_type import DriveType, FrameContent, Span
from drivers.moteus import codec
from drivers.moteus.axis import MoteusAxis
from drivers.moteus.bench import MoteusBench
from drivers.moteus.codec import Mode
from drivers.moteus.gate_table import KIND, gate_table
from drivers.moteus.parameters import LARGEST_ID, SMALLEST_ID, MoteusParameters

NAN, ABSENT = bytes.fromhex("0000c07f"), bytes.fromhex("80")
SPANS: Mapping[str, Span] = {  # of the reply to a question for all signals: see codec.py
    "position": Span(5, 13, 2 * NAN),
    "current": Span(15, 19, NAN),
    "heartbeat": Span(2, 3, ABSENT),
    "temperature": Span(21, 22, ABSENT),
    "voltage": Span(24, 25, ABSENT),
}
SIGNALS = ("position", "current", "heartbeat", "error", "temperature", "voltage")
MOTOR_DRIVER_FAULT = 33
UNUSED_NODE = LARGEST_ID


class Moteus(DriveType):
    """Describes the moteus protocol."""

    parameters = MoteusParameters
    axis = MoteusAxis
    gate_table = staticmethod(gate_table)
    bench = MoteusBench()
    kind = KIND
    example_error = MOTOR_DRIVER_FAULT
    command = FrameRate(codec.TORQUE_BYTES, RATE_HZ, KIND.is_extended, KIND.is_fd)
    reports = (FrameRate(codec.REPLY_BYTES, RATE_HZ, KIND.is_extended, KIND.is_fd),)

    def identifiers(self, parameters: DriveParameters) -> frozenset[int]:
        node_id = parameters.node_id
        return frozenset(
            identifier | FD for identifier in (codec.reply_id(node_id), codec.command_id(node_id), node_id)
        )

    def query(self, node_id: int) -> Frame:
        return codec.command_frame(node_id, codec.QUERY_ALONE)

    def announces(self, node_id: int) -> Frame:
        identifier, reply = codec.reply_id(node_id), codec.AT_REST
        return Frame(
            identifier, codec.encode_reply(reply), is_extended=identifier > 0x7FF, is_fd=True, bit_rate_switch=True
        )

    def read_frame(self, frame: Frame) -> FrameContent | None:
        if not frame.is_fd or frame.is_error:
            return None
        source, destination = frame.arbitration_id >> 8 & 0x7F, frame.arbitration_id & 0xFF
        if source == codec.HOST and SMALLEST_ID <= destination <= LARGEST_ID:
            return FrameContent(destination, is_command=True)
        if destination != codec.HOST:
            return None
        if len(frame.data) == codec.REPLY_BYTES and frame.data[0] == codec.FIRST_REPLY_BYTE:
            return FrameContent(source, signals=SIGNALS, spans=SPANS)
        return FrameContent(source)

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Only a command feeds its watchdog. Questions want no answer: it would look like a second drive's."""
        unanswered = self.query(node_id)._replace(arbitration_id=node_id, is_extended=False)
        return {
            "questions for the signals": unanswered,
            "answers of another drive": self.announces(UNUSED_NODE),
        }

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        with suppress(MalformedMessageError):
            reply = codec.decode_reply(frame.data)
            mode = Mode.FAULT if flags else Mode.STOPPED if idle else reply.mode
            return codec.encode_reply(reply._replace(mode=mode, fault=flags & 0x7F if flags else reply.fault))
        return frame.data
