"""The requests that users may make through the robot's socket."""

import pytest

from verification.virtual_machine.robot import UNAUTHORISED, Robot

NOT_PERMITTED = 4  # the documented exit status of `mudskipper`


def test_an_operator_arms_walks_stops_and_disarms(robot: Robot) -> None:
    assert robot.succeed("arm") == "hold\n"
    assert robot.succeed("walk", "--depth", "3") == "walking\n"
    robot.shell("sleep 2")
    report = robot.status()
    assert (report["mode"], report["fault"]) == ("walking", None)
    assert report["stride"] >= 0
    assert robot.succeed("stop") == "hold\n"
    assert robot.succeed("disarm") == "idle\n"
    assert robot.torque_is_off()


def test_the_processors_are_kept_awake_while_torque_is_on(robot: Robot) -> None:
    limit_us = "od -A n -t d4 /dev/cpu_dma_latency"  # by all programs' requests
    assert int(robot.shell(limit_us)) > 1e6
    robot.succeed("arm")
    assert int(robot.shell(limit_us)) == 0
    robot.succeed("disarm")
    assert int(robot.shell(limit_us)) > 1e6


@pytest.mark.parametrize("command", ["arm", "walk", "status", "clear"])
def test_an_unauthorised_user_is_refused(booted: Robot, command: str) -> None:
    answer = booted.operate(command, user=UNAUTHORISED)
    assert answer.status == NOT_PERMITTED
    assert "group mudskipper" in answer.errors


def test_an_unauthorised_user_may_stop_a_walk(walking: Robot) -> None:
    walking.operate("stop", user=UNAUTHORISED)
    walking.wait_for('mudskipper status --json | grep -q \'"mode": "hold"\'')


def test_an_unauthorised_user_reads_neither_log_nor_state(booted: Robot) -> None:
    answer = booted.machine.run("ls /var/lib/mudskipper/logs", user=UNAUTHORISED)
    assert answer.status != 0
    assert "Permission denied" in answer.errors


def test_the_service_for_viewers_reads_and_stops_but_never_drives(walking: Robot) -> None:
    walking.shell("systemctl start mudskipper-live")
    walking.wait_for("python3 -c 'import urllib.request as u; u.urlopen(\"http://127.0.0.1:8765/\")'")
    own = walking.shell("grep ^Groups: /proc/$(systemctl show --value --property=MainPID mudskipper-live)/status")
    drivers = walking.shell("getent group mudskipper").split(":")[2]
    assert drivers not in own.split()
    as_the_service = "systemd-run --quiet --pipe --wait --property=DynamicUser=yes"
    as_the_service += " --property=SupplementaryGroups=mudskipper-view /opt/mudskipper/venv/bin/mudskipper"
    for command in ("disarm", "arm", "walk", "clear"):
        answer = walking.machine.run(f"{as_the_service} {command}")
        assert (answer.status == 0) == (command == "disarm"), answer
    assert walking.torque_is_off()
    walking.shell("systemctl stop mudskipper-live")
