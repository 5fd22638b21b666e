"""The settings of a simulated ODrive, which are read and written by the numbers of their parameters, and stored.

Written settings are in the drive's memory, and a restart forgets them unless they were stored before. `BUILD` has the
numbers as ODrive publishes them with each build of its firmware, in flat_endpoints.json. Firmware 0.6.11 confirms what
was written by the message that also answers a question.
"""

from dataclasses import replace

from drivers.can.frames import MalformedMessageError
from drivers.odrive import codec
from drivers.odrive.setup import CAN, CONTROLLER, ENABLE, LAYOUTS, MOTOR, SDO_WRITE, TIMEOUT
from simulation.devices.drive import SimulatedDriveParameters

WATCHDOG_TIMEOUT_ENDPOINT, ENABLE_WATCHDOG_ENDPOINT = 1, 2  # of hardware 0.0.0, which no real board has
SLOW = ("error", "temperature", "bus_voltage")
PERIODS = {
    f"{CAN}.encoder_msg_rate_ms": "encoder_period_s",
    f"{CAN}.iq_msg_rate_ms": "current_period_s",
    f"{CAN}.heartbeat_msg_rate_ms": "heartbeat_period_s",
} | {f"{CAN}.{name}_msg_rate_ms": "slow_period_s" for name in SLOW}
PLAIN = {
    f"{CAN}.node_id": "node_id",
    f"{MOTOR}.torque_constant": "torque_constant_nm_a",
    f"{CONTROLLER}.vel_gain": "velocity_gain_nm_s_turn",
}
FIXED = {f"{MOTOR}.current_soft_max": 10.0, f"{CONTROLLER}.vel_limit": 2.0}  # as delivered; the bus sets both
TYPES = {TIMEOUT: "float", ENABLE: "bool"} | dict.fromkeys(PERIODS, "uint32") | dict.fromkeys((*PLAIN, *FIXED), "float")
TYPES[f"{CAN}.node_id"] = "uint32"
ENDPOINTS = {key: 10 + index for index, key in enumerate(TYPES)} | {
    TIMEOUT: WATCHDOG_TIMEOUT_ENDPOINT,
    ENABLE: ENABLE_WATCHDOG_ENDPOINT,
}
KEYS = {endpoint: key for key, endpoint in ENDPOINTS.items()}
BUILD = {
    "fw_version": "0.6.11",
    "hw_version": "0.0.0",
    "endpoints": {key: {"id": ENDPOINTS[key], "type": name, "access": "rw"} for key, name in TYPES.items()},
}


class OdriveSettings:
    """Owns what was written to one drive, and what it has stored."""

    def __init__(self) -> None:
        self._written: dict[str, float] = {}
        self._stored: dict[str, float] = {}
        self._delivered: SimulatedDriveParameters | None = None  # from the first writing on

    def execute(self, data: bytes, parameters: SimulatedDriveParameters) -> tuple[bytes, SimulatedDriveParameters]:
        """Execute one message; return the answer, empty for an unknown parameter, and the drive as it is then."""
        try:
            opcode, endpoint, _ = codec.RX_SDO.decode(data[: codec.SDO_HEAD_BYTES])
            key = KEYS[endpoint]
            layout = LAYOUTS[TYPES[key]]
            if opcode != SDO_WRITE and len(data) != codec.SDO_HEAD_BYTES:
                return b"", parameters
            if opcode == SDO_WRITE:
                (value,) = layout.unpack_from(data, codec.SDO_HEAD_BYTES)
                parameters = self._write(key, value, parameters)
        except (MalformedMessageError, KeyError):
            return b"", parameters
        value = self._value(key, parameters)
        number = value if TYPES[key] == "float" else round(value)
        return codec.TX_SDO.encode(0, endpoint, 0) + layout.pack(number), parameters

    def save(self) -> None:
        self._stored = dict(self._written)

    def restart(self, parameters: SimulatedDriveParameters) -> SimulatedDriveParameters:
        """Forget what was not stored."""
        self._written = dict(self._stored)
        return self._applied() if self._delivered else parameters

    def _write(self, key: str, value: float, parameters: SimulatedDriveParameters) -> SimulatedDriveParameters:
        self._delivered = self._delivered or parameters
        self._written[key] = value
        return self._applied()

    def _value(self, key: str, parameters: SimulatedDriveParameters) -> float:
        if key in self._written:
            return self._written[key]
        if key in PERIODS:
            return 1e3 * float(getattr(parameters, PERIODS[key]))
        if key == ENABLE:
            return float(parameters.watchdog_s > 0.0)
        return parameters.watchdog_s if key == TIMEOUT else FIXED.get(key) or float(getattr(parameters, PLAIN[key]))

    def _applied(self) -> SimulatedDriveParameters:
        assert self._delivered is not None
        delivered, written = self._delivered, self._written
        changes = {PLAIN[key]: value for key, value in written.items() if key in PLAIN}
        changes |= {PERIODS[key]: value / 1e3 for key, value in written.items() if key in PERIODS}
        if ENABLE in written or TIMEOUT in written:
            enabled = self._value(ENABLE, delivered)
            changes["watchdog_s"] = self._value(TIMEOUT, delivered) if enabled else 0.0
        return replace(delivered, **changes)  # type: ignore[arg-type]
