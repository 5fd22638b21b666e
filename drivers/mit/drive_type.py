"""MIT mode as a drive type: its parameters, its axis, and how to read and forge its frames without commanding one."""

from collections.abc import Mapping

from control.rate import RATE_HZ
from drivers.can.bus_load import FrameRate
from drivers.can.frames import Frame
from drivers.drive import DriveParameters
from drivers.drive_type import DriveType, FrameContent, Span
from drivers.mit import codec
from drivers.mit.axis import MASTER_ID, MitAxis
from drivers.mit.bench import MitBench
from drivers.mit.gate_table import gate_table
from drivers.mit.models import MODELS
from drivers.mit.parameters import LARGEST_ID, MitParameters
from drivers.mit.settings import SUPPLY_V

# All other signals of an answer arrive together or not at all: no code says that one is unknown.
ROTOR_TEMPERATURE: Mapping[str, Span] = {"temperature": Span(7, 8, bytes(1))}  # of a Damiao
DRIVE_TEMPERATURE: Mapping[str, Span] = {"temperature": Span(6, 7, bytes(1))}  # of a CubeMars
WIDE_TEMPERATURE: Mapping[str, Span] = {"temperature": Span(6, 8, bytes(2))}  # of a RobStride
VOLTAGE: Mapping[str, Span] = {"voltage": Span(4, 8, None)}  # the value of a Damiao's register
SIGNALS = ("position", "current", "heartbeat", "error", "temperature")
DAMIAO_OFFSET = 16  # of the id under which a Damiao answers
OVERCURRENT = 0xA  # of a Damiao; its low bits are that of a CubeMars
ROBSTRIDE_OVERCURRENT = 1 << 4  # of phase B
MODEL = MODELS["DM4310"]
ROBSTRIDES = frozenset(name for name, model in MODELS.items() if model.reports_faults_apart)


class Mit(DriveType):
    """Describes MIT mode."""

    parameters = MitParameters
    axis = MitAxis
    gate_table = staticmethod(gate_table)
    bench = MitBench()
    example_error = OVERCURRENT
    command = FrameRate(codec.ANSWER_BYTES, RATE_HZ)
    reports = (FrameRate(codec.ANSWER_BYTES, RATE_HZ),)

    def identifiers(self, parameters: DriveParameters) -> frozenset[int]:
        """Also those of other makers' drives, which differ in the model alone."""
        node_id = parameters.node_id
        of_robstride = isinstance(parameters, MitParameters) and parameters.model in ROBSTRIDES
        masters = {MASTER_ID, codec.ROBSTRIDE_MASTER} if of_robstride else {MASTER_ID}
        return frozenset({*masters, node_id, node_id + DAMIAO_OFFSET, codec.REGISTER_ID})

    def query(self, node_id: int) -> Frame:
        return Frame(node_id, codec.LEAVE)

    def announces(self, node_id: int) -> Frame:
        answer = codec.Answer(
            node_id=node_id & LARGEST_ID,
            status=codec.DISABLED,
            position_rad=0.0,
            velocity_rad_s=0.0,
            torque_nm=0.0,
            temperature_c=0.0,
            last=0,
        )
        return Frame((node_id & LARGEST_ID) + DAMIAO_OFFSET, codec.encode_answer(answer, MODEL))

    def read_frame(self, frame: Frame) -> FrameContent | None:
        """A CubeMars answers under its own id, with that id as the first byte, which no command of this program has.

        Of an answer under id 0, also a RobStride's, the temperature is read as that of an older CubeMars.
        """
        identifier, data = frame.arbitration_id, frame.data
        if not frame.is_plain:
            return None
        if identifier == codec.REGISTER_ID and data:
            return FrameContent(data[0] & LARGEST_ID)
        if identifier in (MASTER_ID, codec.ROBSTRIDE_MASTER) and data:
            signals = ("error",) if codec.is_faults(data) else SIGNALS
            spans = WIDE_TEMPERATURE if identifier else DRIVE_TEMPERATURE
            return FrameContent(data[0] & LARGEST_ID, signals=signals, spans=spans)
        node_id = identifier & LARGEST_ID
        if identifier > DAMIAO_OFFSET + LARGEST_ID or not node_id:
            return None
        if identifier < DAMIAO_OFFSET and data[:1] != bytes([node_id]):
            return FrameContent(node_id, is_command=True)
        if identifier > DAMIAO_OFFSET and codec.is_register_answer(data, node_id):
            return FrameContent(node_id, signals=("voltage",) * (data[3] == SUPPLY_V), spans=VOLTAGE)
        of_damiao = identifier > DAMIAO_OFFSET
        return FrameContent(node_id, signals=SIGNALS, spans=ROTOR_TEMPERATURE if of_damiao else DRIVE_TEMPERATURE)

    def harmless_frames(self, node_id: int) -> Mapping[str, Frame]:
        """Only a command should feed the watchdog."""
        other = node_id % LARGEST_ID + 1
        return {
            "answers of another drive": self.announces(other),
            "questions for another drive's registers": Frame(codec.REGISTER_ID, codec.encode_read(other, 9)),
        }

    def with_error(self, frame: Frame, flags: int, idle: bool) -> bytes:
        """Set a Damiao's status, or the fault of a CubeMars; that of a RobStride where it reports them."""
        data, of_damiao = frame.data, frame.arbitration_id > LARGEST_ID
        if len(data) != codec.ANSWER_BYTES:
            return data
        if frame.arbitration_id == codec.ROBSTRIDE_MASTER:
            has_faults = codec.is_faults(data) and flags
            return codec.encode_faults(data[0], ROBSTRIDE_OVERCURRENT) if has_faults else data
        if of_damiao:
            status = 0x8 | flags & 0x7 if flags else codec.DISABLED if idle else data[0] >> 4
            return bytes([data[0] & 0xF | status << 4]) + data[1:]
        return data[:-1] + bytes([flags & 0x7 if flags else data[-1]])
