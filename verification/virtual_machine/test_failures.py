"""The daemon is killed, stopped or misconfigured: systemd's reaction, and no robot that arms by itself."""

from firmware_host.configuration.configuration import EXIT_CONFIGURATION
from verification.virtual_machine.robot import CONFIGURATION, Robot


def restarts(robot: Robot) -> int:
    return int(robot.unit("NRestarts"))


def test_a_killed_daemon_is_started_again_and_is_disarmed(walking: Robot) -> None:
    process, before = walking.unit("MainPID"), restarts(walking)
    walking.shell(f"kill -KILL {process}")
    walking.wait_for(f"test $(systemctl show --value --property=NRestarts mudskipper) -gt {before}")
    walking.wait_until_answers()
    assert walking.unit("MainPID") != process
    assert restarts(walking) == before + 1
    assert walking.torque_is_off()


def test_a_daemon_that_hangs_is_ended_by_the_watchdog_and_started_again_disarmed(walking: Robot) -> None:
    process, before = walking.unit("MainPID"), restarts(walking)
    walking.shell(f"kill -STOP {process}")
    walking.wait_for(f"test $(systemctl show --value --property=NRestarts mudskipper) -gt {before}")
    walking.wait_until_answers()
    assert walking.unit("MainPID") != process
    assert "Watchdog timeout (limit 2s)!" in walking.journal()
    assert walking.torque_is_off()


def test_the_robot_s_own_watchdogs_take_the_torque_away_while_the_daemon_hangs(walking: Robot) -> None:
    """Heartbeats report the drives' state: 8 is closed loop, 1 is idle."""
    walking.shell(f"kill -STOP {walking.unit('MainPID')}; sleep 1")
    heartbeats = walking.shell("timeout 0.5 candump -L vcan0,001:7FF; true").splitlines()
    assert heartbeats
    assert all(line.rpartition("#")[2][8:10] == "01" for line in heartbeats)


def test_a_wrong_configuration_stops_the_service_once_with_status_78(robot: Robot) -> None:
    robot.shell(f"cp -p {CONFIGURATION} /etc/mudskipper/good.toml")
    robot.shell(f"sed -i 's/^torque_nm = .*/torque_nm = 75/' {CONFIGURATION}")
    assert robot.machine.run("systemctl restart mudskipper").status != 0
    robot.shell("sleep 3")
    assert (robot.unit("ActiveState"), robot.unit("Result")) == ("failed", "exit-code")
    assert robot.unit("ExecMainStatus") == str(EXIT_CONFIGURATION)
    assert robot.unit("NRestarts") == "0"
    assert "limits.torque_nm = 75" in robot.journal()
