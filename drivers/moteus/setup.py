"""Reads, writes and stores the settings of one moteus over CAN, by the text commands of its console.

`conf get` reads a setting, `conf set` writes the drive's memory, `conf write` stores everything, and `conf load` reads
back what is stored: after it, the memory shows what will last. Source: docs/protocol/diagnostic.md of mjbots/moteus.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress

from drivers.bench.bench_port import NoAnswerError
from drivers.bench.drive_setup import AskedSetup, CannotReadError, FoundDrive, Setting, exactly, watchdog
from drivers.can.frames import Frame, MalformedMessageError
from drivers.moteus import codec, registers
from drivers.moteus.codec import Mode
from drivers.moteus.parameters import LARGEST_ID, SMALLEST_ID, MoteusParameters
from drivers.moteus.registers import Register, Resolution
from drivers.moteus.settings import (
    IDENTITY,
    KV,
    MAX_CURRENT,
    MOST_CONSOLE_BYTES,
    POLL,
    RATIO,
    REGISTER_MAP,
    SAME_FRACTION,
    SAME_TORQUE_FRACTION,
    TIMEOUT_MODE,
    TORQUE_FACTOR,
    WATCHDOG,
    MoteusSettings,
)

ID = "id.id"
BRAKES = 15.0  # the timeout mode that the set-up page asks for
LONGEST_LINE_S, STORING_S = 0.5, 3.0
MOST_POLLS = 20
MODE = registers.padded(registers.encode_read(Resolution.INT8, Register.MODE))
GUIDE = "docs/how-to/moteus.md"
MEASURED = "a property of the motor, which moteus_tool --calibrate measures: correct torque_constant_nm_a"


def is_reply(frame: Frame) -> bool:
    source, destination = frame.arbitration_id >> 8, frame.arbitration_id & 0xFF
    return frame.is_fd and not frame.is_error and destination == codec.HOST and SMALLEST_ID <= source <= LARGEST_ID


def found_drive(frame: Frame) -> FoundDrive | None:
    """Return the drive that answers with the registers of its identity; None for any other frame."""
    values = _values(frame)
    node_id = frame.arbitration_id >> 8
    settings = MoteusSettings(MoteusParameters("", node_id))
    settings.on_registers(values)
    if not (is_reply(frame) and settings.firmware):
        return None
    map_problem = f"register map {values[Register.REGISTER_MAP]:.0f}: needs {REGISTER_MAP}"
    return FoundDrive(
        type="moteus",
        node_id=node_id,
        hardware=f"model {values.get(Register.MODEL, 0.0):.0f}",
        firmware=settings.firmware,
        serial_number=settings.serial_number,
        problem="" if settings.supported else map_problem,
    )


class MoteusSetup(AskedSetup):
    stored = "it has read them back from its store"

    _parameters: MoteusParameters

    def identify(self) -> FoundDrive:
        answer = self._ask(IDENTITY, "its identity", lambda frame: found_drive(frame) is not None)
        found = found_drive(answer)
        assert found is not None
        return found

    def activity(self) -> str:
        answer = self._ask(MODE, "its mode", lambda frame: Register.MODE in _values(frame))
        mode = int(_values(answer)[Register.MODE])
        return "" if mode == Mode.STOPPED else f"mode {mode}"

    def settings(self) -> Sequence[Setting]:
        drive = self._parameters
        kv = TORQUE_FACTOR / drive.torque_constant_nm_a
        return (
            exactly(ID, drive.node_id, "node_id", "it answers under this id"),
            exactly(MAX_CURRENT, drive.current_limit_a, "current_limit_a", fraction=SAME_FRACTION),
            exactly(KV, kv, "torque_constant_nm_a", MEASURED, SAME_TORQUE_FRACTION),
            exactly(RATIO, 1.0, GUIDE),
            exactly(TIMEOUT_MODE, BRAKES, GUIDE),
            watchdog(WATCHDOG, self._longest_watchdog_s),
        )

    def read(self, key: str) -> float:
        line = self._command(f"conf get {key}")
        try:
            return float(line)
        except ValueError:
            raise CannotReadError(f"{key}: the drive answers '{line}'") from None

    def write(self, key: str, value: float) -> None:
        """Write a whole number without a point, as the drive's integers need; NaN is `nan`."""
        self._require_ok(f"conf set {key} {f'{value:.0f}' if value % 1.0 == 0.0 else f'{value:.9g}'}")

    def save(self) -> None:
        self._require_ok("conf write", STORING_S)
        self._require_ok("conf load", STORING_S)

    def _require_ok(self, command: str, longest_s: float = LONGEST_LINE_S) -> None:
        line = self._command(command, longest_s)
        if line != "OK":
            raise CannotReadError(f"'{command}': the drive answers '{line}'")

    def _command(self, text: str, longest_s: float = LONGEST_LINE_S) -> str:
        """Return the line that answers a command, after discarding older output."""
        for _ in range(MOST_POLLS):
            if not self._poll(POLL, text):
                break
        console = registers.encode_console(registers.CONSOLE_INPUT, f"{text}\n".encode())
        output = b""
        data = registers.padded(console + registers.encode_console_poll(MOST_CONSOLE_BYTES))
        begun_s = self._port.now_s
        while b"\n" not in output:
            if self._port.now_s - begun_s > longest_s:
                raise NoAnswerError(f"no answer to '{text}'")
            output += self._poll(data, text)
            data = POLL
        return output.partition(b"\n")[0].decode(errors="replace").strip()

    def _poll(self, data: bytes, text: str) -> bytes:
        """Return the output that the drive has now."""
        answer = self._ask(data, f"'{text}'", lambda frame: _output(frame) is not None)
        return _output(answer) or b""

    def _ask(self, data: bytes, what: str, is_answer: Callable[[Frame], bool]) -> Frame:
        node_id = self._parameters.node_id
        return self._port.ask(
            codec.command_frame(node_id, data),
            lambda frame: is_reply(frame) and frame.arbitration_id == codec.reply_id(node_id) and is_answer(frame),
            what,
        )


def _values(frame: Frame) -> dict[int, float]:
    with suppress(MalformedMessageError):
        return registers.replied_values(registers.decode_frame(frame.data))
    return {}


def _output(frame: Frame) -> bytes | None:
    """Return the console's text in an answer; None for another answer."""
    with suppress(MalformedMessageError):
        texts = [each.text for each in registers.decode_frame(frame.data) if each.kind == registers.CONSOLE_OUTPUT]
        return b"".join(texts) if texts else None
    return None
