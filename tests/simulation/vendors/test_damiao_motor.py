"""The package `damiao-motor` operates a simulated Damiao through a whole session, and our driver reads what it sets."""

import time
from typing import Any

import pytest
from damiao_motor import DaMiaoController  # type: ignore[import-untyped]

from drivers.mit import codec
from drivers.mit.models import MODELS
from drivers.mit.parameters import MitParameters
from tests.simulation.vendors.vendor_bench import VendorBench, vendor_bench, wait_until

STEP_NM = MODELS["DM4310"].torque_step_nm
TORQUE_NM = 0.3
TIMEOUT_MS = 150
REGISTERS = {0: 15.0, 1: 0.083, 16: 14, 20: 1.0, 59: 12.0, 60: 24.0, 61: 30.0, 62: 30.0}


def operate(bench: VendorBench) -> None:
    """Find, set, arm, command, let the watchdog expire, recover, set zero, and disarm."""
    controller: Any = DaMiaoController(bench.channel, "virtual")
    motor = controller.add_motor(1, 17, "4310")

    def has_status(status: int) -> bool:
        motor.request_motor_feedback()
        return bool(motor.get_states().get("status_code") == status)

    try:
        wait_until(lambda: has_status(codec.DISABLED), "found")
        assert {register: motor.get_register(register) for register in REGISTERS} == pytest.approx(REGISTERS)
        motor.ensure_control_mode("MIT")
        motor.set_can_timeout(TIMEOUT_MS)
        for _ in range(2):
            motor.enable()
            wait_until(lambda: has_status(codec.ENABLED), "enabled")
            for _ in range(10):
                motor.send_cmd_mit(feedforward_torque=TORQUE_NM)
                time.sleep(0.01)
            assert bench.torque_nm == pytest.approx(TORQUE_NM, abs=STEP_NM)
            assert motor.get_states()["torq"] == pytest.approx(TORQUE_NM, abs=2.0 * STEP_NM)
            assert motor.get_states()["pos"] == pytest.approx(bench.angle_rad, abs=0.1)
            wait_until(lambda: has_status(codec.LOST_COMMANDS), "its time-out, which questions do not feed")
            assert bench.torque_nm == 0.0
            motor.clear_error()
            wait_until(lambda: has_status(codec.DISABLED), "cleared")
        bench.velocity_rad_s = 0.0
        motor.set_zero_position()
        wait_until(lambda: has_status(codec.DISABLED) and abs(motor.get_states()["pos"]) < 0.01, "its new zero")
        assert abs(bench.angle_rad) > 0.01
    finally:
        controller.shutdown()


def test_damiao_motor_operates_a_drive_and_our_driver_reads_what_it_has_set() -> None:
    parameters = MitParameters(bus="a", node_id=1, serial_number="0badcafe")
    with vendor_bench("mit", serial="0badcafe") as bench, bench.driver(parameters) as ours:
        operate(bench)
        axis = ours.read_until(lambda axis: axis.health.watchdog_s > 0.0 and axis.health.serial_number != "")
    assert axis.health.watchdog_s == pytest.approx(1e-3 * TIMEOUT_MS) and axis.health.serial_number == "0badcafe"
    assert axis.health.foreign_commands > 20 and not axis.closed_loop and not axis.health.setting_problem
