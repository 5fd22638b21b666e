"""The package `odrive_can` operates a simulated ODrive through a whole session, and our driver sees it."""

from __future__ import annotations

import asyncio
from math import pi
from typing import Any

import pytest
from odrive_can.odrive import DriveError, ODriveCAN

from drivers.odrive.parameters import OdriveParameters
from tests.simulation.vendors.vendor_bench import VendorBench, vendor_bench, wait_until

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
        assert bench.torques_nm[0] == pytest.approx(TORQUE_NM)
        assert speeds_turn_s[-1] == pytest.approx(bench.velocities_rad_s[0] / TURN_RAD, rel=0.5)
        await asyncio.sleep(0.35)  # without a command, and until the next heartbeat
        assert bench.torques_nm[0] == 0.0
        with pytest.raises(DriveError, match="WATCHDOG"):
            drive.check_errors()
        drive.clear_errors()
        await asyncio.sleep(0.15)
        drive.check_errors()
    await drive.set_axis_state("CLOSED_LOOP_CONTROL")
    drive.stop()
    wait_until(lambda: not bench.drives[0].energised, "idle")


def test_odrive_can_operates_a_drive_through_a_whole_session_and_our_driver_sees_it() -> None:
    with vendor_bench("odrive", watchdog_s=0.15, serial_number=SERIAL) as bench:
        parameters = OdriveParameters(bus="a", node_id=1, serial_number=SERIAL)
        with bench.driver(parameters) as ours:
            asyncio.run(operate(ODriveCAN(1, bench.open_bus()), bench))  # it closes its bus
            axis = ours.read_until(lambda axis: axis.health.serial_number != "" and axis.health.foreign_commands > 0)
        assert axis.health.foreign_commands > 20 and not axis.closed_loop and axis.health.serial_number == SERIAL
