"""The body's position from an encoder on its rail: a serial port on which a counter sends one count per line.

encoder_counts.py decodes the lines and rejects implausible counts; serial_line.py opens and reads the port. Where the
counts begin again, one read has no pose: the body has not moved so far, and no stroke must count it as motion. An
unplugged port is opened again between two ticks and only while nothing moves, because that may take milliseconds.
"""

from dataclasses import dataclass
from typing import Annotated

from control.bounds import Bounds, Meaning
from control.records import NEVER_S, BodyPose
from drivers.pose.pose_port import STALE_S, PoseReport, PoseSourceError
from drivers.serial.encoder_counts import EncoderCounts
from drivers.serial.serial_line import SerialLine, SerialLineError

LONGEST_LINE_BYTES = 64
RETRY_S = 1.0  # between attempts to open a device that is gone


@dataclass(frozen=True)
class RailEncoderParameters:
    device: Annotated[
        str, Meaning("serial port; a name under /dev/serial/by-id stays the same wherever it is plugged in")
    ] = ""
    bit_rate: Annotated[int, Bounds(300, 4_000_000), Meaning("of the serial line", "bit/s")] = 115_200
    metres_per_count: Annotated[
        float, Bounds(-1.0, 1.0), Meaning("negative where counts fall on the way forward", "m/count")
    ] = 0.0
    label: Annotated[str, Meaning("with which each line begins")] = ""


class RailEncoder:
    """Implements PoseSource. Owns its serial line, its counts, and the newest pose."""

    def __init__(self, parameters: RailEncoderParameters, origin_m: float = 0.0) -> None:
        """Open the device; raises PoseSourceError. `origin_m` is the counter's position where x is zero."""
        self.parameters = parameters
        device = parameters.device
        try:
            self.line = SerialLine(device, parameters.bit_rate, LONGEST_LINE_BYTES, RETRY_S)
        except SerialLineError as problem:
            raise PoseSourceError(f"the rail encoder {device} does not open: {problem.why}") from None
        self._counts = EncoderCounts(parameters.metres_per_count, parameters.label, origin_m)
        self._now_s = NEVER_S
        self.reset()

    def reset(self) -> None:
        """Restore the state after opening."""
        self._pose = BodyPose()
        self._counts.reset()
        self.line.reset()

    @property
    def poses(self) -> int:
        return self._counts.accepted

    @property
    def malformed(self) -> int:
        return self._counts.malformed

    def read(self, now_s: float) -> BodyPose:
        self._now_s, was_there, jumps = now_s, self.line.is_there, self._counts.jumps
        for line in self.line.read(now_s):
            x_m = self._counts.accept(line, now_s)
            if x_m is not None:
                self._pose = BodyPose(now_s, x_m)
        if was_there and not self.line.is_there:
            self.reset()
        is_known = now_s - self._pose.stamp_s <= STALE_S and self._counts.jumps == jumps
        return self._pose if is_known else BodyPose()

    def reopen(self, now_s: float) -> bool:
        """Try to open a lost device again, every RETRY_S; return whether it did."""
        return self.line.reopen(now_s)

    def report(self) -> PoseReport:
        device = self.parameters.device
        report = PoseReport(f"rail encoder {device}", self.poses, self.malformed)
        if self.line.problem is not None and not self.line.is_there:
            return report._replace(
                trouble=f"the rail encoder is gone: {self.line.problem.why}.",
                what_to_do="plug it in; it is opened again while the torque is off",
            )
        if self._now_s - self._pose.stamp_s <= STALE_S:
            return report
        return report._replace(
            trouble=f"no count arrives from {device}.",
            what_to_do="check its power and pose.rail_encoder.bit_rate and label",
        )

    def close(self) -> None:
        self.line.close()
