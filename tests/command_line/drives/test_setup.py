"""`mudskipper drives setup` compares, writes, backs up and restores, and refuses drives that are not as configured."""

import os
import signal
import tomllib
from functools import partial
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.drives.backup_file import write_backup
from drivers.can.bus_lock import BusRole
from drivers.mit.setup import MST_ID
from firmware_host.buses import lock_buses
from firmware_host.configuration.loading import load_configuration
from tests.command_line.drives.bench_setup import MakeBench
from tests.drivers.bench.simulated_bus import simulated

WATCHDOG = {"odrive": "axis0.config.enable_watchdog", "moteus": "servo.default_timeout_s", "mit": "TIMEOUT"}


@pytest.fixture
def make_unset(make_bench: MakeBench) -> MakeBench:
    """Return a function that makes a robot whose drives have no watchdog yet."""
    return partial(make_bench, watchdog_s=0.0)


@pytest.mark.parametrize("name", WATCHDOG)
def test_different_settings_are_written_backed_up_and_restored(make_unset: MakeBench, name: str) -> None:
    bench = make_unset(name)
    compared = bench.run("setup")
    assert compared.returncode == exit_codes.UNHEALTHY and "differs" in compared.stdout
    written = bench.run("setup", "--write", "--backup", "old.toml")
    assert written.returncode == exit_codes.OK and written.stdout.count("it has the new settings") == 4
    assert bench.run("setup").returncode == exit_codes.OK
    backup = tomllib.loads(Path("old.toml").read_text(encoding="utf-8"))
    assert set(backup) == {"left_sweep", "left_adduction", "right_sweep", "right_adduction"}
    assert all(WATCHDOG[name] in each["old"] and WATCHDOG[name] in each["new"] for each in backup.values())
    after = bench.run("setup", "--backup", "old.toml").stdout
    assert "left_sweep has the new settings of old.toml" in after
    restored = bench.run("setup", "--restore", "old.toml")
    assert restored.returncode == exit_codes.OK and "left_sweep: it has the restored settings" in restored.stdout
    assert "left_sweep had the new settings" in restored.stdout and "has the new" not in restored.stdout
    assert "left_sweep has the old settings" in bench.run("setup", "--backup", "old.toml").stdout


def test_a_damiao_with_a_range_of_its_own_is_set_up_again_and_restored(make_bench: MakeBench) -> None:
    """Its ranges are those of no model then, which only the configuration explains."""
    bench = make_bench("mit")
    bench.change("[drive.left_sweep]", "[drive.left_sweep]\ntorque_range_nm = 2.0")
    for arguments in (("--write", "--backup", "old.toml"), (), ("--restore", "old.toml")):
        assert bench.run("setup", *arguments).returncode == exit_codes.OK
        assert bench.run("find").returncode == exit_codes.OK
    assert bench.run("setup").stdout.count("differs") == 1


def test_a_damiao_as_delivered_gets_the_id_of_its_answers(make_bench: MakeBench) -> None:
    bench = make_bench("mit")
    for drive in bench.drives.values():
        drive._feedback_id = drive.registers[MST_ID] = 0  # type: ignore[attr-defined]
    assert "MST_ID" in bench.run("find").stdout
    written = bench.run("setup", "--write", "--backup", "old.toml")
    assert written.returncode == exit_codes.OK and written.stdout.count("it has the new settings") == 4


def test_one_joint_alone_is_changed(make_unset: MakeBench) -> None:
    bench = make_unset()
    ended = bench.run("setup", "left_sweep", "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.OK
    assert set(tomllib.loads(Path("old.toml").read_text(encoding="utf-8"))) == {"left_sweep"}
    assert not bench.buses["right"].sent


def test_a_period_is_written_as_the_whole_milliseconds_that_an_odrive_has(make_unset: MakeBench) -> None:
    bench = make_unset()
    bench.change("[drive.left_sweep]", "[drive.left_sweep]\nheartbeat_period_s = 0.0333")
    ended = bench.run("setup", "left_sweep", "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.OK, ended.stdout


def test_a_backup_is_never_replaced(make_unset: MakeBench) -> None:
    bench = make_unset()
    Path("old.toml").write_text("precious", encoding="utf-8")
    ended = bench.run("setup", "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.USAGE and "name another file" in ended.stderr
    assert Path("old.toml").read_text(encoding="utf-8") == "precious"
    assert not any(bus.sent for bus in bench.buses.values())


def test_ctrl_c_leaves_the_old_settings_and_says_so(make_unset: MakeBench) -> None:
    bench = make_unset()
    bench.run("setup")
    read = len(bench.buses["left"].sent)
    bench.buses["left"].at_frame = (2 * read + 2, lambda: signal.raise_signal(signal.SIGINT))
    ended = bench.run("setup", "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.INTERRUPTED
    assert "interrupted: it has the old settings" in ended.stdout and "after it were not changed" in ended.stdout
    assert "left_sweep has the old settings" in bench.run("setup", "--backup", "old.toml").stdout


@pytest.mark.parametrize("joints", [(), ("left_sweep",)])
def test_a_cable_that_comes_out_is_reported_with_what_the_drive_has(
    make_unset: MakeBench, joints: tuple[str, ...]
) -> None:
    bench = make_unset()
    bench.run("setup", *joints)
    bench.buses["left"].unplugged_after = 2 * len(bench.buses["left"].sent) + 2
    ended = bench.run("setup", *joints, "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.UNHEALTHY
    assert "nothing was stored, so it has the old settings once its supply was switched off and on" in ended.stdout
    assert ("after it were not changed" in ended.stdout) is not bool(joints)


def test_two_drives_with_one_id_are_refused(make_unset: MakeBench) -> None:
    bench = make_unset()
    bench.buses["left"].drives.append(simulated("odrive", 0, "123"))
    ended = bench.run("setup", "--write")
    assert ended.returncode == exit_codes.UNHEALTHY
    assert "id 0 answers 2 times" in ended.stderr and "nothing was read or written" in ended.stderr
    assert not list(Path().glob("drives-*.toml"))


def test_the_exit_status_says_what_still_differs_after_writing(make_bench: MakeBench) -> None:
    """`motor.Kv` is never written."""
    bench = make_bench("moteus", torque_constant_nm_a=0.1)
    ended = bench.run("setup", "--write", "--backup", "old.toml")
    assert ended.stdout.count("it has the new settings") == 4 and "4 settings differ, 0 were not read" in ended.stdout
    assert ended.returncode == exit_codes.UNHEALTHY


def test_what_cannot_be_read_is_not_restored(make_unset: MakeBench) -> None:
    bench = make_unset()
    bench.run("setup", "--write", "--backup", "old.toml")
    Path("flat_endpoints.json").unlink()
    ended = bench.run("setup", "--restore", "old.toml")
    assert ended.returncode == exit_codes.UNHEALTHY and "name the flat_endpoints.json of firmware" in ended.stderr


def test_a_file_of_another_drive_is_not_restored(make_unset: MakeBench) -> None:
    bench = make_unset()
    bench.run("setup", "--write", "--backup", "old.toml")
    text = Path("old.toml").read_text(encoding="utf-8")
    Path("old.toml").write_text(text.replace("0badcafe", "12345678"), encoding="utf-8")
    ended = bench.run("setup", "--restore", "old.toml")
    assert ended.returncode == exit_codes.UNHEALTHY and "serial number" in ended.stderr


def test_a_backup_is_on_the_disk_under_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, synchronised = tmp_path / "old.toml", []
    target = "/proc/self/fd/{}".format
    monkeypatch.setattr(os, "fsync", lambda file: synchronised.append((os.readlink(target(file)), path.exists())))
    write_backup(path, [], {})
    assert synchronised == [(str(tmp_path / ".old.toml"), False), (str(tmp_path), True)]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ("--endpoints bad.json", "no JSON"),
        ("--endpoints other.json", "no flat_endpoints.json"),
        ("--restore other.json", "other.json"),
        ("--restore empty.toml", "empty.toml"),
    ],
)
def test_a_wrong_argument_is_refused_before_anything_is_written(
    make_unset: MakeBench, arguments: str, named: str
) -> None:
    bench = make_unset()
    Path("bad.json").write_text("{", encoding="utf-8")
    Path("other.json").write_text('{"a": 1}', encoding="utf-8")
    Path("empty.toml").touch()
    ended = bench.run("setup", *arguments.split())
    assert ended.returncode == exit_codes.CONFIGURATION and named in ended.stderr


def test_without_the_numbers_of_the_build_the_watchdog_of_the_configuration_is_read(make_unset: MakeBench) -> None:
    bench = make_unset()
    Path("flat_endpoints.json").unlink()
    ended = bench.run("setup", "left_sweep")
    assert "2 settings differ, 11 were not read" in ended.stdout
    assert "flat_endpoints.json of firmware 0.6.11, hardware 0.0.0" in ended.stdout


@pytest.mark.parametrize("command", ["find", "setup --write", "zero left_sweep --yes"])
def test_a_bus_that_the_daemon_commands_is_refused(make_unset: MakeBench, command: str) -> None:
    bench = make_unset()
    with lock_buses(load_configuration(bench.config).bus, BusRole.COMMANDS):
        ended = bench.run(*command.split())
    assert ended.returncode == exit_codes.UNHEALTHY and "systemctl stop mudskipper" in ended.stderr
    assert not any(bus.sent for bus in bench.buses.values())


def test_firmware_0_5_is_found_and_named_as_not_settable(make_unset: MakeBench) -> None:
    bench = make_unset("odrive05")
    ended = bench.run("setup", "--write")
    assert ended.stdout.count("odrivetool") == 4 and not list(Path().glob("drives-*.toml"))
