"""Reads, writes and stores the settings of one ODrive over CAN, by the numbers of its parameters.

ODrive renumbers its parameters in every build, and publishes the numbers as flat_endpoints.json. A number of another
build is another parameter, so only a table of the very firmware and hardware that the drive reports is used. Storing is
the reboot message with action 1, after which the board restarts: what it reads back then is what it has stored. Source:
ODrive's CANSimple documentation, and examples/can_restore_config.py of odriverobotics/ODriveResources.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from struct import Struct, error
from typing import Any, NamedTuple

from drivers.bench.bench_port import BenchPort, NoAnswerError
from drivers.bench.drive_setup import AskedSetup, CannotReadError, FoundDrive, Setting, encoded, exactly, watchdog
from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import WatchdogEndpoints
from drivers.odrive import codec
from drivers.odrive.codec import AxisState, Message, arbitration_id
from drivers.odrive.parameters import OdriveParameters
from drivers.odrive.settings import SUPPORTED

CAN, MOTOR, CONTROLLER = "axis0.config.can", "axis0.config.motor", "axis0.controller.config"
ENABLE, TIMEOUT = "axis0.config.enable_watchdog", "axis0.config.watchdog_timeout"
LAYOUTS = {  # by the name of a type in flat_endpoints.json; longer ones do not fit into a frame
    "bool": Struct("<?"),
    "uint8": Struct("<B"),
    "int8": Struct("<b"),
    "uint16": Struct("<H"),
    "int16": Struct("<h"),
    "uint32": Struct("<I"),
    "int32": Struct("<i"),
    "float": Struct("<f"),
}
SDO_WRITE, SAVE = 1, 1  # opcode; action of the reboot message
RESTART_S, SILENT_S = 10.0, 2.0  # until it answers again; until it must have fallen silent
GUIDE = "docs/how-to/odrive.md"


class Number(NamedTuple):
    endpoint: int
    layout: Struct


class Build(NamedTuple):
    """The numbers of parameters in one build of the firmware."""

    firmware: str
    hardware: str
    numbers: Mapping[str, Number]


def build_of_file(document: Any) -> Build:
    """Return the table of a flat_endpoints.json. Raises ValueError for another document."""
    try:
        numbers = {
            key: Number(int(each["id"]), LAYOUTS[each["type"]])
            for key, each in document["endpoints"].items()
            if each.get("type") in LAYOUTS
        }
        return Build(str(document["fw_version"]), str(document["hw_version"]), numbers)
    except (KeyError, TypeError, AttributeError) as problem:
        raise ValueError("is no flat_endpoints.json: fw_version, hw_version or endpoints is missing") from problem


def build_of_watchdog(endpoints: WatchdogEndpoints) -> Build:
    numbers = {
        ENABLE: Number(endpoints.enable, LAYOUTS["bool"]),
        TIMEOUT: Number(endpoints.timeout, LAYOUTS["float"]),
    }
    return Build(endpoints.firmware, endpoints.hardware, numbers)


def _period(message: str, longest_ms: float) -> Setting:
    key = f"{CAN}.{message}_msg_rate_ms"
    return Setting(key=key, wanted=longest_ms, least=1.0, most=longest_ms, source=GUIDE)


def found_drive(node_id: int, version: Sequence[int], serial_number: str = "") -> FoundDrive:
    """Return the drive that reports this version: the values of GET_VERSION."""
    firmware, hardware = (".".join(map(str, version[part])) for part in (slice(4, 7), slice(1, 4)))
    supported = tuple(version[4:6]) == SUPPORTED
    return FoundDrive(
        type="odrive",
        node_id=node_id,
        hardware=hardware,
        firmware=firmware,
        serial_number=serial_number,
        problem="" if supported else f"firmware {firmware} is not supported: needs 0.6",
    )


class OdriveSetup(AskedSetup):
    """Owns the numbers of the drive's build, once it is identified."""

    _parameters: OdriveParameters
    stored = "it has restarted with them"

    def __init__(
        self, port: BenchPort, parameters: OdriveParameters, longest_watchdog_s: float, builds: Sequence[Build]
    ) -> None:
        super().__init__(port, parameters, longest_watchdog_s)
        self._builds = builds
        self._numbers: dict[str, Number] = {}
        self._build = ""

    def identify(self) -> FoundDrive:
        version = codec.GET_VERSION.decode(self._request(codec.GET_VERSION, "its version", 8))
        found = found_drive(self._parameters.node_id, version)
        self._build = f"firmware {found.firmware}, hardware {found.hardware}"
        self._numbers = {}
        for build in self._builds:
            if (build.firmware, build.hardware) == (found.firmware, found.hardware):
                self._numbers |= build.numbers
        if found.problem or version[4:7] < codec.FIRST_WITH_ADDRESS:
            return found
        number = codec.decode_serial_number(self._request(codec.ADDRESS, "its serial number", 7))
        return found._replace(serial_number=number)

    def activity(self) -> str:
        _, state, _, _ = codec.HEARTBEAT.decode(self._request(codec.HEARTBEAT, "its heartbeat", 8))
        return "" if state == AxisState.IDLE else f"axis state {state}"

    def settings(self) -> Sequence[Setting]:
        drive = self._parameters
        return (
            exactly(f"{CAN}.node_id", drive.node_id, "node_id", "it answers under this id"),
            *(_period(name, 2.0) for name in ("encoder", "iq")),
            exactly(f"{CAN}.heartbeat_msg_rate_ms", round(1e3 * drive.heartbeat_period_s), "heartbeat_period_s"),
            *(_period(name, 100.0) for name in ("error", "temperature", "bus_voltage")),
            watchdog(TIMEOUT, self._longest_watchdog_s),
            exactly(ENABLE, 1.0, GUIDE),
            exactly(f"{MOTOR}.torque_constant", drive.torque_constant_nm_a, "torque_constant_nm_a"),
            exactly(f"{MOTOR}.current_soft_max", drive.current_limit_a, "current_limit_a"),
            exactly(f"{CONTROLLER}.vel_limit", drive.velocity_limit_turn_s, "velocity_limit_turn_s"),
            exactly(f"{CONTROLLER}.vel_gain", drive.velocity_gain_nm_s_turn, "velocity_gain_nm_s_turn"),
        )

    def read(self, key: str) -> float:
        number = self._number(key)
        question = codec.RX_SDO.encode(codec.SDO_READ, number.endpoint, 0)
        answer = self._port.ask(
            Frame(arbitration_id(self._parameters.node_id, codec.RX_SDO), question),
            lambda frame: self._is_from(frame, codec.TX_SDO) and _answers(frame.data, number.endpoint),
            key,
        )
        try:
            (value,) = number.layout.unpack_from(codec.decode_sdo(answer.data)[1])
        except error as problem:
            raise NoAnswerError(f"{key} was answered with {len(answer.data)} bytes") from problem
        return float(value)

    def write(self, key: str, value: float) -> None:
        """Write; firmware from 0.6.11 on confirms it, older ones do not, so the value is read back."""
        number = self._number(key)
        data = encoded(number.layout, key, value)
        head = codec.RX_SDO.encode(SDO_WRITE, number.endpoint, 0)
        self._port.send(Frame(arbitration_id(self._parameters.node_id, codec.RX_SDO), head + data))
        self._port.listen(0.01)

    def save(self) -> None:
        self._port.send(Frame(arbitration_id(self._parameters.node_id, codec.REBOOT), codec.REBOOT.encode(SAVE)))
        if not self._comes_to(False, SILENT_S):
            raise NoAnswerError("it did not restart")
        if not self._comes_to(True, RESTART_S):
            raise NoAnswerError(f"it did not answer within {RESTART_S:g} s of its restart")

    def _comes_to(self, answering: bool, longest_s: float) -> bool:
        """Ask for the version again and again; return whether the drive came to answer, or to be silent, in time."""
        begun_s = self._port.now_s
        while self._port.now_s - begun_s < longest_s:
            try:
                self._request(codec.GET_VERSION, "its version", 8)
                answered = True
            except NoAnswerError:
                answered = False
            if answered is answering:
                return True
        return False

    def _number(self, key: str) -> Number:
        if key not in self._numbers:
            raise CannotReadError(f"no number is known for it: name the flat_endpoints.json of {self._build}")
        return self._numbers[key]

    def _request(self, message: Message, what: str, least_bytes: int) -> bytes:
        question = Frame(arbitration_id(self._parameters.node_id, message), is_remote=True)
        return self._port.ask(
            question, lambda frame: self._is_from(frame, message) and len(frame.data) >= least_bytes, what
        ).data

    def _is_from(self, frame: Frame, message: Message) -> bool:
        return frame.is_plain and frame.arbitration_id == arbitration_id(self._parameters.node_id, message)


def _answers(data: bytes, endpoint: int) -> bool:
    with suppress(MalformedMessageError):
        return codec.decode_sdo(data)[0] == endpoint
    return False
