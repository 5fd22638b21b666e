"""One ODrive with firmware 0.6 as one joint: its errors and temperature, and the settings that it is asked for.

cansimple_axis.py has all that both firmwares have in common.
"""

from collections.abc import Callable, Mapping, Sequence

from drivers.drive import DriveHealth, Outlet, WatchdogEndpoints
from drivers.odrive import codec
from drivers.odrive.cansimple_axis import CanSimpleAxis
from drivers.odrive.codec import Message
from drivers.odrive.parameters import OdriveParameters
from drivers.odrive.settings import SUPPORTED, DriveSettings


class OdriveAxis(CanSimpleAxis):
    COMMANDS = codec.COMMANDS
    CLEAR_ERRORS = codec.CLEAR_ERRORS.encode(0)  # without blinking

    def __init__(
        self, joint: str, parameters: OdriveParameters, outlet: Outlet, endpoints: Sequence[WatchdogEndpoints] = ()
    ) -> None:
        super().__init__(joint, parameters, outlet, DriveSettings(parameters.serial_number, endpoints))

    def reset(self) -> None:
        super().reset()
        self.disarm_reason = 0

    @property
    def _reports(self) -> Mapping[Message, Callable[[bytes, float], None]]:
        return {
            **super()._reports,
            codec.HEARTBEAT: self._receive_heartbeat,
            codec.GET_ERROR: self._receive_error,
            codec.GET_TEMPERATURE: self._receive_temperature,
            codec.TX_SDO: self._receive_parameter,
            codec.ADDRESS: self._receive_address,
            codec.RX_SDO: self._receive_foreign_access,
        }

    def _receive_heartbeat(self, data: bytes, now_s: float) -> None:
        flags, state, _, _ = codec.HEARTBEAT.decode(data)
        self._set_errors(flags, self.disarm_reason)
        self._receive_state(state, bool(flags & codec.ERROR_INITIALIZING), now_s)

    def _receive_error(self, data: bytes, now_s: float) -> None:
        self._set_errors(*codec.GET_ERROR.decode(data))

    def _set_errors(self, flags: int, disarm_reason: int) -> None:
        if (flags, disarm_reason) != (self._error_flags, self.disarm_reason):
            self._error_flags, self.disarm_reason, self._health = flags, disarm_reason, None

    def _receive_temperature(self, data: bytes, now_s: float) -> None:
        _, self._temperature_c = codec.GET_TEMPERATURE.decode(data)
        self._temperature_stamp_s = now_s

    def _receive_parameter(self, data: bytes, now_s: float) -> None:
        self.settings.on_parameter(data)
        self._health = None

    def _receive_address(self, data: bytes, now_s: float) -> None:
        self.settings.on_address(data)
        self._health = None

    def _receive_foreign_access(self, data: bytes, now_s: float) -> None:
        if data and data[0] != codec.SDO_READ:
            self._receive_foreign_command(data, now_s)

    def _build_health(self) -> DriveHealth:
        flags, settings = self._error_flags | self.disarm_reason, self.settings
        common = super()._build_health()
        build = f"firmware {settings.firmware}, hardware {settings.hardware}"
        return common._replace(
            firmware=settings.firmware,
            supported_firmware=".".join(map(str, SUPPORTED)),
            firmware_supported=settings.supported,
            hardware=settings.hardware,
            watchdog_s=settings.watchdog_s,
            watchdog_advice=f"name the parameter numbers of {build} in [[watchdog_endpoints]]",
            power_cut=bool(self._error_flags & codec.POWER_CUT),
            watchdog_expired=bool(flags & codec.ERROR_WATCHDOG),
            serial_number=settings.serial_number,
            expected_serial_number=settings.expected_serial_number,
            active_errors=codec.error_text(self._error_flags),
            errors=codec.error_text(flags),
        )
