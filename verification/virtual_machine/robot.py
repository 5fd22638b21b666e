"""The robot inside the virtual machine, for an operator with a shell on it."""

import json
from typing import Any

from verification.virtual_machine.machine import Answer, Machine

OPERATOR, UNAUTHORISED = "alice", "mallory"  # only the first is in the group
LOGS = "/var/lib/mudskipper/logs"
CONFIGURATION = "/etc/mudskipper/mudskipper.toml"
REST = """\
cd /etc/mudskipper
if [ -e good.toml ]; then mv good.toml mudskipper.toml; fi
for bus in vcan0 vcan1; do
    ip link show $bus >/dev/null 2>&1 || ip link add $bus type vcan
    ip link set $bus up
    cansend $bus 20000100#0000000000000000
done
systemctl reset-failed
systemctl start simulated-robot mudskipper
until mudskipper status --json 2>/dev/null | grep -q closed_loop; do sleep 0.5; done
mudskipper disarm >/dev/null
systemctl kill --signal=USR1 simulated-robot
sleep 0.2
mudskipper clear >/dev/null 2>&1
true
"""


class Robot:
    def __init__(self, machine: Machine) -> None:
        self.machine = machine

    def shell(self, command: str, longest_s: float = 60.0) -> str:
        """Run a command as root and return its output. Fails where the command fails."""
        answer = self.machine.run(command, longest_s=longest_s)
        assert answer.status == 0, f"{command}\n{answer.output}{answer.errors}{self.journal()}"
        return answer.output

    def operate(self, *arguments: str, user: str = OPERATOR) -> Answer:
        """Run `mudskipper ARGUMENTS`, whether it succeeds or not."""
        return self.machine.run(" ".join(("mudskipper", *arguments)), user=user)

    def succeed(self, *arguments: str) -> str:
        answer = self.operate(*arguments)
        assert answer.status == 0, f"{arguments}: {answer}\n{self.journal()}"
        return answer.output

    def status(self) -> dict[str, Any]:
        report: dict[str, Any] = json.loads(self.operate("status", "--json").output)
        return report

    def unit(self, name: str) -> str:
        """Return a property of the service from systemd."""
        return self.shell(f"systemctl show --value --property={name} mudskipper").strip()

    def journal(self) -> str:
        return self.machine.run("journalctl --boot --unit=mudskipper --no-pager --output=cat --lines=40").output

    def wait_for(self, condition: str) -> None:
        """Wait until a shell command succeeds."""
        self.shell(f"until {condition}; do sleep 0.5; done", 20.0)

    def wait_until_answers(self) -> None:
        self.wait_for("mudskipper status --json | grep -q closed_loop")

    def wait_until_ready(self) -> None:
        """Wait until the robot can be armed."""
        self.wait_for("mudskipper check >/dev/null")

    def walk(self) -> None:
        """Walk from idle; return in the first stride."""
        assert self.succeed("arm") == "hold\n"
        self.succeed("walk", "--depth", "3")

    def walks_without_faults(self) -> bool:
        answer = self.operate("status", "--json")
        if answer.status != 0:
            return False
        report = json.loads(answer.output)
        return report["mode"] == "walking" and not report["faults"]

    def rest(self) -> None:
        """Return the robot to idle without faults, as after a start."""
        self.shell(REST)
        self.wait_until_ready()

    def put_back(self) -> None:
        """Move the flippers back from beyond their limits, as an operator does by hand."""
        self.shell("systemctl kill --signal=USR1 simulated-robot; sleep 0.2")

    def torque_is_off(self) -> bool:
        return not any(drive["closed_loop"] for drive in self.status()["drives"])
