"""What one ODrive reports of itself when it is asked: its firmware, its watchdog, its serial number.

A restart forgets all of it. The watchdog is read back by parameter number (SDO). ODrive renumbers its parameters in
every build and for each kind of board, and publishes the numbers as flat_endpoints.json with the firmware. Without the
numbers of this very build the watchdog stays unknown, because a number of another build reads some other parameter.
"""

from collections.abc import Iterator, Sequence
from math import isfinite, nan

from control.records import NEVER_S, UNKNOWN
from drivers.can.frames import Frame, MalformedMessageError
from drivers.drive import WatchdogEndpoints
from drivers.odrive import codec
from drivers.odrive.codec import arbitration_id

SUPPORTED = (0, 6)  # major and minor version of the firmware whose messages the codec knows
REPEAT_UNKNOWN_S = 0.5  # between two requests for a setting that is still unknown
REFRESH_S = 2.0  # between two requests for a known setting, which may be changed over USB
LONGEST_WATCHDOG_S = 3600.0  # a larger number is no time-out


class DriveSettings:
    """Owns the answers of one drive."""

    def __init__(self, expected_serial_number: str = "", endpoints: Sequence[WatchdogEndpoints] = ()) -> None:
        self.expected_serial_number = expected_serial_number  # empty: any
        self._endpoints = tuple(endpoints)
        self.reset()

    def reset(self) -> None:
        self._requested_s = {"version": NEVER_S, "watchdog": NEVER_S, "serial number": NEVER_S}
        self.forget()

    def forget(self) -> None:
        self.version: tuple[int, int, int] | None = None
        self.hardware = ""
        self.serial_number = ""  # empty until the drive has reported it
        self._watchdog_enabled: bool | None = None
        self._watchdog_timeout_s = UNKNOWN

    def on_version(self, data: bytes) -> None:
        fields = codec.GET_VERSION.decode(data)
        self.version = fields[4:7]
        self.hardware = ".".join(str(field) for field in fields[1:4])

    def on_address(self, data: bytes) -> None:
        self.serial_number = codec.decode_serial_number(data)

    def on_parameter(self, data: bytes) -> None:
        endpoint, value = codec.decode_sdo(data)
        endpoints = self.watchdog_endpoints
        if endpoints is None:  # the drive answers another program
            return
        if endpoint == endpoints.enable:
            self._watchdog_enabled = codec.decode_sdo_flag(value)
        elif endpoint == endpoints.timeout:
            timeout_s = codec.decode_sdo_float(value)
            if not 0.0 <= timeout_s <= LONGEST_WATCHDOG_S:
                raise MalformedMessageError("not a time")
            self._watchdog_timeout_s = timeout_s

    def due_requests(self, node_id: int, now_s: float) -> Iterator[Frame]:
        """Yield the frames that ask for settings: unknown ones every REPEAT_UNKNOWN_S, all others every REFRESH_S.

        A version that is not supported is asked for as an unknown one: it may have been a garbled frame.
        """
        if self._is_due("version", self.supported, now_s):
            yield Frame(arbitration_id(node_id, codec.GET_VERSION), is_remote=True)
        endpoints = self.watchdog_endpoints
        if self._is_due("watchdog", isfinite(self.watchdog_s), now_s) and endpoints is not None:
            for endpoint in (endpoints.enable, endpoints.timeout):
                yield Frame(arbitration_id(node_id, codec.RX_SDO), codec.RX_SDO.encode(codec.SDO_READ, endpoint, 0))
        # Older firmware would take this request for a new node id. A known one is checked where another is expected.
        is_wanted = self._reports_serial_number and (self.expected_serial_number or not self.serial_number)
        if self._is_due("serial number", bool(self.serial_number), now_s) and is_wanted:
            yield Frame(arbitration_id(node_id, codec.ADDRESS), is_remote=True)

    def _is_due(self, setting: str, is_known: bool, now_s: float) -> bool:
        if now_s - self._requested_s[setting] < (REFRESH_S if is_known else REPEAT_UNKNOWN_S):
            return False
        self._requested_s[setting] = now_s
        return True

    @property
    def _reports_serial_number(self) -> bool:
        return self.supported and self.version is not None and self.version >= codec.FIRST_WITH_ADDRESS

    @property
    def supported(self) -> bool:
        return self.version is not None and self.version[:2] == SUPPORTED

    @property
    def firmware(self) -> str:
        """The version as ODrive writes it; empty until it is known."""
        return ".".join(map(str, self.version or ()))

    @property
    def watchdog_endpoints(self) -> WatchdogEndpoints | None:
        """The numbers of the drive's own build, once its version is known."""
        if self.version is None:
            return None
        build = (self.firmware, self.hardware)
        return next((each for each in self._endpoints if (each.firmware, each.hardware) == build), None)

    @property
    def watchdog_s(self) -> float:
        """The time-out that the drive uses: NaN until it was read back, 0 where the watchdog is off."""
        if self._watchdog_enabled is None:
            return nan
        return self._watchdog_timeout_s if self._watchdog_enabled else 0.0
