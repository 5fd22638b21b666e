"""The modules that are tested by mutation, the tests of each, and the mutants that change nothing."""

from typing import NamedTuple

EVERY_MUTANT = "not every_branch and not kernel and not on_a_port"  # the others need a subprocess or a kernel


class Subject(NamedTuple):
    module: str
    tests: tuple[str, ...]  # in the order in which they run, below tests/
    selected: str = ""  # pytest's expression of the tests that run
    equivalent: dict[str, str] = {}  # the text of a mutant that behaves the same, and why


SUBJECTS = (
    Subject("drivers.transmit_gate", ("drivers/test_transmit_gate.py",), EVERY_MUTANT),
    Subject("drivers.odrive.gate_tables", ("drivers/test_transmit_gate.py",), EVERY_MUTANT),
    Subject("drivers.can.reopening_port", ("drivers/can/test_reopening_port.py",)),
    Subject("control.limits", ("control/test_limits.py",)),
    Subject("control.modes", ("control/test_modes.py",)),
    Subject("control.fault_latch", ("control/test_fault_latch.py",)),
    Subject("control.monitors.joint_monitor", ("control/monitors/test_joint_monitor.py",)),
    Subject("control.monitors.encoder_monitor", ("control/monitors/test_encoder_monitor.py",)),
    Subject("firmware_host.operator.lease", ("firmware_host/operator/test_lease.py",)),
)
