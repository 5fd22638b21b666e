"""The makers' `moteus.Controller` over python-can operates a simulated moteus, and our driver reads what it sets."""

import asyncio
from math import nan
from typing import Any

import can
import moteus  # type: ignore[import-untyped]
import pytest

from drivers.moteus.parameters import MoteusParameters
from tests.simulation.vendors.vendor_bench import VendorBench, vendor_bench, wait_until

TORQUE_NM = 0.1
CONSTANT_NM_A = 0.0719
TIMEOUT_S = 0.15
SERIAL = "0123456789abcdef00112233"
PURE_TORQUE = {"position": nan, "kp_scale": 0.0, "kd_scale": 0.0, "ilimit_scale": 0.0, "query": True}


async def operate(bench: VendorBench) -> None:
    """Find, set, arm, command, let the watchdog expire, recover, use the other modes, and disarm."""
    transport = moteus.PythonCan(interface="virtual", channel=bench.channel, protocol=can.CanProtocol.CAN_FD)
    query = moteus.QueryResolution()
    query.q_current = moteus.F32
    drive: Any = moteus.Controller(id=1, transport=transport, query_resolution=query)
    try:
        stream: Any = moteus.Stream(drive)
        await stream.command(f"conf set servo.default_timeout_s {TIMEOUT_S}".encode())
        assert float(await stream.command(b"conf get servo.default_timeout_s", allow_any_response=True)) == TIMEOUT_S
        registers = moteus.Register
        await drive.set_stop()
        for _ in range(2):
            for _ in range(10):
                result = await drive.set_position(feedforward_torque=TORQUE_NM, **PURE_TORQUE)
                await asyncio.sleep(0.01)
            assert bench.torque_nm == pytest.approx(TORQUE_NM)
            assert result.values[registers.MODE] == moteus.Mode.POSITION
            assert result.values[registers.TORQUE] == pytest.approx(TORQUE_NM)
            assert result.values[registers.Q_CURRENT] == pytest.approx(TORQUE_NM / CONSTANT_NM_A)
            await asyncio.sleep(1.3 * TIMEOUT_S)
            result = await drive.set_position(feedforward_torque=TORQUE_NM, **PURE_TORQUE)
            assert result.values[registers.MODE] == moteus.Mode.TIMEOUT and bench.torque_nm == 0.0
            await drive.set_stop()
            assert (await drive.query()).values[registers.MODE] == moteus.Mode.STOPPED
        await drive.set_current(q_A=1.0, d_A=0.0)
        wait_until(lambda: bench.torque_nm == pytest.approx(CONSTANT_NM_A) and bench.velocity_rad_s > 0.01, "a current")
        for brake in (drive.set_brake, drive.set_zero_velocity):
            await brake()
            wait_until(lambda: bench.torque_nm * bench.velocity_rad_s < 0.0, "a brake")
        await drive.set_stop()
        unknown = await drive.custom_query({0x3FF: moteus.F32})
        assert 0x3FF not in unknown.values
    finally:
        transport.close()


def test_the_makers_controller_operates_a_drive_and_our_driver_reads_what_it_has_set() -> None:
    changes: dict[str, Any] = {"torque_constant_nm_a": CONSTANT_NM_A, "serial": SERIAL}
    with vendor_bench("moteus", fd=True, **changes) as bench:
        parameters = MoteusParameters(bus="a", node_id=1, torque_constant_nm_a=CONSTANT_NM_A, serial_number=SERIAL)
        with bench.driver(parameters) as ours:
            asyncio.run(operate(bench))
            axis = ours.read_until(lambda axis: axis.health.watchdog_s > 0.0 and axis.health.serial_number != "")
    assert axis.health.watchdog_s == pytest.approx(TIMEOUT_S) and axis.health.serial_number == SERIAL
    assert axis.health.foreign_commands > 20 and not axis.closed_loop and not axis.health.setting_problem
