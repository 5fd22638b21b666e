"""The installed service under systemd: ready, real-time, without privileges, and readable in the journal."""

import json
import re

from verification.virtual_machine.robot import Robot

FIFO = 1  # SCHED_FIFO in /proc/PID/stat
POLICY_FIELD = 41 - 3  # of proc(5), counted behind the name
LOWEST_LOCKED_KIB = 20_000  # the interpreter and its libraries alone


def process_status(robot: Robot) -> dict[str, str]:
    text = robot.shell(f"cat /proc/{robot.unit('MainPID')}/status")
    return dict(line.split(":\t", 1) for line in text.splitlines() if ":\t" in line)


def policies(robot: Robot, processes: str) -> list[int]:
    stats = robot.shell(f"for process in {processes}; do cat /proc/$process/task/*/stat; done")
    return [int(line.rpartition(")")[2].split()[POLICY_FIELD]) for line in stats.splitlines()]


def test_the_system_boots_without_a_failed_unit(booted: Robot) -> None:
    assert booted.shell("systemctl is-system-running --wait") == "running\n"


def test_the_service_becomes_ready_by_itself(booted: Robot) -> None:
    assert (booted.unit("ActiveState"), booted.unit("SubState")) == ("active", "running")
    assert booted.unit("NRestarts") == "0"


def test_both_buses_are_up_by_the_network_files_alone(booted: Robot) -> None:
    links = json.loads(booted.shell("ip -json -details link show type vcan"))
    assert {link["ifname"] for link in links if "UP" in link["flags"]} == {"vcan0", "vcan1"}


def test_two_controllers_are_set_up_by_the_network_files_alone(booted: Robot) -> None:
    """QEMU emulates them: the robot's own buses are virtual ones, which have neither bit rate nor bus-off."""
    links = json.loads(booted.shell("ip -json -details link show type can"))
    assert [link["ifname"] for link in links if "UP" in link["flags"]] == ["can0", "can1"]
    for link in links:
        settings = link["linkinfo"]["info_data"]
        assert (settings["bittiming"]["bitrate"], settings["restart_ms"], link["txqlen"]) == (1_000_000, 100, 32)


def test_every_line_of_check_is_good(booted: Robot) -> None:
    answer = booted.operate("check")
    assert answer.status == 0, answer
    assert "FAIL" not in answer.output
    warnings = [line for line in answer.output.splitlines() if line.startswith("warn ")]
    assert len(warnings) == 1 and "protection is weakened (a virtual machine" in warnings[0]


def test_real_time_is_for_the_loop_s_thread_alone(booted: Robot) -> None:
    main = booted.unit("MainPID")
    processes = booted.shell("cat /sys/fs/cgroup/system.slice/mudskipper.service/cgroup.procs").split()
    assert len(processes) > 1  # the log's writer is there too
    assert policies(booted, main) == [FIFO]
    assert FIFO not in policies(booted, " ".join(process for process in processes if process != main))


def test_the_daemon_s_memory_is_locked(booted: Robot) -> None:
    assert int(process_status(booted)["VmLck"].split()[0]) > LOWEST_LOCKED_KIB


def test_the_daemon_has_no_privileges(booted: Robot) -> None:
    status = process_status(booted)
    assert "0" not in status["Uid"].split()
    assert {int(status[name], 16) for name in ("CapEff", "CapPrm", "CapBnd", "CapAmb")} == {0}
    assert (status["NoNewPrivs"], status["Seccomp"]) == ("1", "2")


def test_the_running_system_rates_the_service_as_well_hardened(booted: Robot) -> None:
    booted.shell("systemd-analyze security --no-pager --threshold=13 mudskipper.service")


def test_the_journal_can_be_read(booted: Robot) -> None:
    text = booted.shell("journalctl --boot --unit=mudskipper --no-pager --output=cat")
    assert re.search(r"^Started mudskipper.service - Mudskipper robot controller\.$", text, re.MULTILINE)
    assert "Traceback" not in text
    assert "warning" not in text.replace("warning: protection is weakened (a virtual machine", "")
