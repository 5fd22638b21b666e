"""The body's place from an encoder on its rail: a serial port on which a counter sends its count, a line each.

A line is a whole number in ASCII, behind a label where one is configured (`x:1234`, `x=1234`, `x 1234`), and ends with
carriage return, line feed or both. The first line after opening may have lost its beginning and is passed over; one
that is no count, or that no body on a rail could have come to since the one before, is counted as garbled. A count
that leaps and stays there is believed from its second line on: a counter that was restarted begins at zero.

pyserial opens and configures the device; reading is one call that never waits. A device that is unplugged is opened
again where it comes back: between two ticks and only while nothing moves, since that may take milliseconds.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from typing import Annotated, Any

from control.bounds import Bounds
from control.records import NEVER_S, UNKNOWN, BodyPose
from drivers.pose_port import STALE_S, PoseReport, PoseSourceError

MOST_BYTES_PER_READ = 4096
LONGEST_LINE_BYTES = 64
RETRY_S = 1.0  # between tries to open a device that is gone
FASTEST_M_S = 2.0  # four times what the flippers' tips reach
SLACK_M = 0.01  # of lines that arrive together
LINE_ENDS = re.compile(rb"[\r\n]+")


@dataclass(frozen=True)
class RailEncoderParameters:
    device: str = ""  # such as /dev/serial/by-id/..., which stays the same wherever it is plugged in
    bit_rate: Annotated[int, Bounds(300, 4_000_000)] = 115_200
    metres_per_count: Annotated[float, Bounds(-1.0, 1.0)] = 0.0  # negative where counts fall on the way ahead
    label: str = ""  # that a line begins with


def open_serial(parameters: RailEncoderParameters) -> Any:
    """A port of pyserial. Raises PoseSourceError."""
    try:
        import serial
    except ImportError:
        raise PoseSourceError("a rail encoder needs pyserial: pip install 'mudskipper[serial]'") from None
    try:
        return serial.Serial(parameters.device, parameters.bit_rate, timeout=0, exclusive=True)
    except (OSError, ValueError) as problem:  # SerialException is an OSError
        number = getattr(problem, "errno", None)
        why = os.strerror(number) if number else str(problem)
        raise PoseSourceError(f"the rail encoder {parameters.device} does not open: {why}") from None


class RailEncoder:
    """A PoseSource. Owns the port, of which there is none while the device is gone, and the line that has begun."""

    def __init__(
        self,
        parameters: RailEncoderParameters,
        origin_m: float = 0.0,
        open_port: Callable[[RailEncoderParameters], Any] = open_serial,
    ) -> None:
        """`origin_m`: the counter's place where x is zero. Raises PoseSourceError."""
        self.parameters = parameters
        self._origin_m = origin_m
        self._open_port = open_port
        label = re.escape(parameters.label.encode())
        separator = rb"\s*[:=]?" if label else rb""
        self._line = re.compile(rb"\s*" + label + separator + rb"\s*([+-]?\d{1,15})\s*")
        self.poses = self.garbled = 0
        self._gone = ""  # why there is no port
        self._retry_s = NEVER_S
        self._now_s = NEVER_S
        self._begin(open_port(parameters))

    def _begin(self, port: Any) -> None:
        self._port: Any = port
        self._file = int(port.fileno())
        os.set_blocking(self._file, False)
        self.reset()

    def reset(self) -> None:
        self._pose = BodyPose()
        self._doubted_m = UNKNOWN
        self._begun = b""
        self._whole = False  # whether the line that has begun was heard from its beginning

    def read(self, now_s: float) -> BodyPose:
        self._now_s = now_s
        if self._port is not None:
            try:
                self._take_in(self._fetch(), now_s)
            except OSError as problem:
                self._lose(problem, now_s)
        return self._pose if now_s - self._pose.stamp_s <= STALE_S else BodyPose()

    def _fetch(self) -> bytes:
        """All that has arrived. Raises OSError where the device is gone."""
        if not self._port.in_waiting:  # an empty read of a device set up by pyserial is no end of it
            return b""
        return os.read(self._file, MOST_BYTES_PER_READ)

    def _take_in(self, data: bytes, now_s: float) -> None:
        *lines, self._begun = LINE_ENDS.split(self._begun + data)
        for line in lines:
            if self._whole and line:
                self._take_line(line, now_s)
            self._whole = True
        if len(self._begun) > LONGEST_LINE_BYTES:
            self.garbled += 1
            self._begun, self._whole = b"", False

    def _take_line(self, line: bytes, now_s: float) -> None:
        count = self._line.fullmatch(line)
        x_m = int(count[1]) * self.parameters.metres_per_count - self._origin_m if count else UNKNOWN
        if self._is_believed(x_m, now_s):
            self.poses += 1
            self._pose = BodyPose(now_s, x_m)
        else:
            self.garbled += 1
            self._doubted_m = x_m

    def _is_believed(self, x_m: float, now_s: float) -> bool:
        if not isfinite(x_m) or not isfinite(self._pose.x_m):
            return isfinite(x_m)
        reach_m = FASTEST_M_S * (now_s - self._pose.stamp_s) + SLACK_M
        return abs(x_m - self._pose.x_m) <= reach_m or abs(x_m - self._doubted_m) <= SLACK_M

    def _lose(self, problem: OSError, now_s: float) -> None:
        self._gone = problem.strerror or str(problem)
        self.close()
        self.reset()
        self._retry_s = now_s + RETRY_S

    def reopen(self, now_s: float) -> bool:
        """Where it was lost, try again once in RETRY_S; whether it was opened anew."""
        if self._port is not None or now_s < self._retry_s:
            return False
        self._retry_s = now_s + RETRY_S
        try:
            self._begin(self._open_port(self.parameters))
        except PoseSourceError as problem:
            self._gone = str(problem)
            return False
        return True

    def report(self) -> PoseReport:
        device = self.parameters.device
        report = PoseReport(f"rail encoder {device}", self.poses, self.garbled)
        if self._port is None:
            return report._replace(
                trouble=f"the rail encoder is gone: {self._gone}.",
                what_to_do="plug it in; it is opened again while the torque is off",
            )
        if self._now_s - self._pose.stamp_s <= STALE_S:
            return report
        return report._replace(
            trouble=f"no count comes from {device}.",
            what_to_do="check its power and pose.rail_encoder.bit_rate and label",
        )

    def close(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            with suppress(OSError):
                port.close()
