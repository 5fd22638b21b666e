"""Detects the faults that mud causes, in a simulated robot whose drives, encoders and wires cannot fail.

These are joints out of their range, too fast, stalled at full torque or hot. The monitors that compare what drives
report with what is possible have nothing to find, and cost a third of the loop.
"""

from control.faults import Fault
from control.records import Torques
from firmware_host.fault_monitor import FaultMonitor, MonitorInput
from firmware_host.ticker import Tick


class LoadMonitor(FaultMonitor):
    def with_probes(self, wanted: Torques, largest_nm: float) -> Torques:
        """Return the wanted torques: nothing here is probed."""
        return wanted

    def update(self, tick: Tick, monitor_input: MonitorInput) -> list[Fault]:
        facts, found = self._facts(tick, monitor_input), list[Fault]()
        for joint, state, torque_nm in zip(
            self.joints, monitor_input.states, monitor_input.sent.torques_nm, strict=True
        ):
            found += joint.update_load(facts, state, torque_nm)
        return found
