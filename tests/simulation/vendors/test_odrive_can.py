"""ODrive's messages as other programs send them: `odrive_can`, and the makers' DBC of both firmwares."""

import asyncio
import time
from collections.abc import Callable
from math import pi
from pathlib import Path
from typing import Any

import can
import cantools
import odrive_can
import pytest
from odrive_can.odrive import DriveError, ODriveCAN

from drivers.odrive import codec
from drivers.odrive.parameters import OdriveParameters
from tests.simulation.vendors.vendor_bench import VendorBench, vendor_bench, wait_until

DBC = Path(odrive_can.__file__).parent / "dbc"
SERIAL = "3766355e3233"
CONSTANT_NM_A = 0.083
TORQUE_NM = 0.1
TURN_RAD = 2.0 * pi


async def operate(drive: Any, bench: VendorBench) -> None:
    """Find, arm, command, let the watchdog expire, recover, and disarm."""
    speeds_turn_s = []
    drive.feedback_callback = lambda message, _: speeds_turn_s.append(message.data["Vel_Estimate"])
    await drive.start()
    assert drive.axis_state == "IDLE"
    drive.check_errors()
    assert (await drive.get_bus_voltage_current())["Bus_Voltage"] == 24.0
    drive.clear_errors()
    drive.set_controller_mode("TORQUE_CONTROL", "PASSTHROUGH")
    drive.set_limits(20.0, 12.0)
    for _ in range(2):
        await drive.set_axis_state("CLOSED_LOOP_CONTROL")
        for _ in range(10):
            drive.set_input_torque(TORQUE_NM)
            await asyncio.sleep(0.01)
        assert bench.torque_nm == pytest.approx(TORQUE_NM)
        assert speeds_turn_s[-1] == pytest.approx(bench.velocity_rad_s / TURN_RAD, rel=0.5)
        await asyncio.sleep(0.35)  # without a command, and until the next heartbeat
        assert bench.torque_nm == 0.0
        with pytest.raises(DriveError, match="WATCHDOG"):
            drive.check_errors()
        drive.clear_errors()
        await asyncio.sleep(0.15)
        drive.check_errors()
    await drive.set_axis_state("CLOSED_LOOP_CONTROL")
    drive.stop()
    wait_until(lambda: not bench.drive.energised, "idle")


def test_odrive_can_operates_a_drive_through_a_whole_session_and_our_driver_sees_it() -> None:
    with vendor_bench("odrive", watchdog_s=0.15, serial=SERIAL) as bench:
        parameters = OdriveParameters(bus="a", node_id=1, serial_number=SERIAL)
        with bench.driver(parameters) as ours:
            asyncio.run(operate(ODriveCAN(1, bench.open_bus()), bench))  # it closes its bus
            axis = ours.read_until(lambda axis: axis.health.serial_number != "" and axis.health.foreign_commands > 0)
        assert axis.health.foreign_commands > 20 and not axis.closed_loop and axis.health.serial_number == SERIAL


class DbcProgram:
    """A program that knows the makers' DBC alone, and sends what cantools encodes."""

    def __init__(self, firmware: str, bench: VendorBench) -> None:
        self._messages: Any = cantools.database.load_file(DBC / f"odrive-cansimple-{firmware}.dbc")
        self._bus = bench.open_bus()
        self.newest: dict[str, dict[str, Any]] = {}  # values of the newest message by name

    def send(self, name: str, **values: Any) -> None:
        message = self._messages.get_message_by_name(f"Axis1_{name}")
        signals = {signal.name: 0 for signal in message.signals} | values
        data = message.encode(signals)
        self._bus.send(can.Message(arbitration_id=message.frame_id, data=data, is_extended_id=False))

    def ask(self, name: str, node_id: int = 1) -> dict[str, Any]:
        """Ask by an empty data frame, and return the answer of node 1."""
        command = self._messages.get_message_by_name(f"Axis1_{name}").frame_id & 0x1F
        self.newest.pop(name, None)
        self._bus.send(can.Message(arbitration_id=node_id << 5 | command, is_extended_id=False))
        self.read_until(lambda: name in self.newest, name)
        return self.newest[name]

    def read_until(self, condition: Callable[[], bool], what: str) -> None:
        def read() -> bool:
            while (message := self._bus.recv(0.0)) is not None:
                known = self._messages.get_message_by_frame_id(message.arbitration_id)
                self.newest[known.name.removeprefix("Axis1_")] = known.decode(bytes(message.data))
            return condition()

        wait_until(read, what)

    def close(self) -> None:
        self._bus.shutdown()


DBC_CASES = {  # firmware: type of the drive, message with the error, its signal, and the watchdog in it
    "0.6.10": ("odrive", "Get_Error", "Disarm_Reason", "WATCHDOG_TIMER_EXPIRED"),
    "0.5.6": ("odrive05", "Heartbeat", "Axis_Error", "WATCHDOG_TIMER_EXPIRED"),
}


@pytest.mark.parametrize("firmware", DBC_CASES)
def test_the_makers_dbc_operates_a_drive_through_a_whole_session(firmware: str) -> None:
    type_name, message, signal, expected = DBC_CASES[firmware]
    with vendor_bench(type_name, watchdog_s=0.15, serial=SERIAL) as bench:
        program = DbcProgram(firmware, bench)
        try:
            program.read_until(lambda: "Heartbeat" in program.newest, "a heartbeat")
            for _ in range(2):
                program.send("Clear_Errors")
                program.send("Set_Controller_Mode", Control_Mode="TORQUE_CONTROL", Input_Mode="PASSTHROUGH")
                program.send("Set_Limits", Velocity_Limit=20.0, Current_Limit=12.0)
                program.send("Set_Axis_State", Axis_Requested_State="CLOSED_LOOP_CONTROL")
                for _ in range(10):
                    program.send("Set_Input_Torque", Input_Torque=-TORQUE_NM)
                    time.sleep(0.01)
                assert bench.torque_nm == pytest.approx(-TORQUE_NM)
                assert program.ask("Get_Iq")["Iq_Measured"] == pytest.approx(-TORQUE_NM / CONSTANT_NM_A, rel=1e-4)
                program.read_until(lambda: str(expected) in str(program.newest.get(message, {}).get(signal)), expected)
                assert bench.torque_nm == 0.0
                program.newest.clear()
            program.send("Set_Axis_State", Axis_Requested_State="IDLE")
        finally:
            program.close()


def test_a_drive_answers_the_makers_questions_to_all_drives() -> None:
    with vendor_bench("odrive", serial=SERIAL) as bench:
        program = DbcProgram("0.6.10", bench)
        try:
            assert program.ask("Get_Version", codec.BROADCAST_NODE)["Fw_Version_Minor"] == 6
            address = program.ask("Address", codec.BROADCAST_NODE)
            assert (address["Node_ID"], address["Serial_Number"]) == (1, int(SERIAL, 16))
        finally:
            program.close()
