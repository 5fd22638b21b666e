"""`mudskipper drives setup` compares, writes, backs up and restores, and refuses drives that are not as configured."""

import os
import signal
import tomllib
from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.drives.backup_file import write_backup
from drivers.can.bus_lock import BusRole
from firmware_host.buses import lock_buses
from firmware_host.configuration.loading import load_configuration
from simulation.harness.drive_presets import calibrated
from tests.command_line.command_lines import run
from tests.command_line.drives.bench_setup import Bench
from tests.drivers.bench.simulated_bus import simulated

WATCHDOG = {"odrive": "axis0.config.enable_watchdog", "moteus": "servo.default_timeout_s", "mit": "TIMEOUT"}


@pytest.fixture
def folder(short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(short_folder)
    return short_folder


def make_bench(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> Bench:
    return Bench(folder, name, monkeypatch, watchdog_s=0.0)


@pytest.mark.parametrize("name", WATCHDOG)
def test_different_settings_are_written_backed_up_and_restored(
    folder: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    config = ("--config", str(make_bench(folder, monkeypatch, name).config))
    compared = run("drives", "setup", *config)
    assert compared.returncode == exit_codes.UNHEALTHY and "differs" in compared.stdout
    written = run("drives", "setup", *config, "--write", "--backup", "old.toml")
    assert written.returncode == exit_codes.OK and written.stdout.count("it has the new settings") == 4
    assert run("drives", "setup", *config).returncode == exit_codes.OK
    backup = tomllib.loads((folder / "old.toml").read_text(encoding="utf-8"))
    assert set(backup) == {"left_sweep", "left_adduction", "right_sweep", "right_adduction"}
    assert all(WATCHDOG[name] in each["old"] and WATCHDOG[name] in each["new"] for each in backup.values())
    after = run("drives", "setup", *config, "--backup", "old.toml").stdout
    assert "left_sweep has the new settings of old.toml" in after
    restored = run("drives", "setup", *config, "--restore", "old.toml")
    assert restored.returncode == exit_codes.OK and "left_sweep: it has the restored settings" in restored.stdout
    assert "left_sweep had the new settings" in restored.stdout and "has the new" not in restored.stdout
    assert "left_sweep has the old settings" in run("drives", "setup", *config, "--backup", "old.toml").stdout


@pytest.mark.parametrize("name", WATCHDOG)
def test_one_joint_alone_is_changed(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    bench = make_bench(folder, monkeypatch, name)
    ended = run("drives", "setup", "left_sweep", "--config", str(bench.config), "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.OK
    assert set(tomllib.loads((folder / "old.toml").read_text(encoding="utf-8"))) == {"left_sweep"}
    assert not bench.buses["right"].sent


def test_a_period_is_written_as_the_whole_milliseconds_that_an_odrive_has(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    bench.change("[drive.left_sweep]", "[drive.left_sweep]\nheartbeat_period_s = 0.0333")
    ended = run("drives", "setup", "left_sweep", "--config", str(bench.config), "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.OK, ended.stdout


def test_a_backup_is_never_replaced(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    (folder / "old.toml").write_text("precious", encoding="utf-8")
    ended = run("drives", "setup", "--config", str(bench.config), "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.USAGE and "name another file" in ended.stderr
    assert (folder / "old.toml").read_text(encoding="utf-8") == "precious"
    assert not any(bus.sent for bus in bench.buses.values())


@pytest.mark.parametrize("name", WATCHDOG)
def test_ctrl_c_leaves_the_old_settings_and_says_so(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    bench = make_bench(folder, monkeypatch, name)
    config = ("--config", str(bench.config))
    run("drives", "setup", *config)
    read = len(bench.buses["left"].sent)
    bench.buses["left"].at_frame = (2 * read + 2, lambda: signal.raise_signal(signal.SIGINT))
    ended = run("drives", "setup", *config, "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.INTERRUPTED
    assert "interrupted: it has the old settings" in ended.stdout and "after it were not changed" in ended.stdout
    assert "left_sweep has the old settings" in run("drives", "setup", *config, "--backup", "old.toml").stdout


def test_a_cable_that_comes_out_is_reported_with_what_the_drive_has(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    config = ("--config", str(bench.config))
    run("drives", "setup", *config)
    bench.buses["left"].unplugged_after = 2 * len(bench.buses["left"].sent) + 2
    ended = run("drives", "setup", *config, "--write", "--backup", "old.toml")
    assert ended.returncode == exit_codes.UNHEALTHY
    assert "nothing was stored, so it has the old settings once its supply was switched off and on" in ended.stdout


def test_two_drives_with_one_id_are_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    bench.buses["left"].drives.append(simulated("odrive", 0, "123"))
    ended = run("drives", "setup", "--config", str(bench.config), "--write")
    assert ended.returncode == exit_codes.UNHEALTHY
    assert "id 0 answers 2 times" in ended.stderr and "nothing was read or written" in ended.stderr
    assert not list(folder.glob("drives-*.toml"))


def test_a_drive_of_another_protocol_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(folder, monkeypatch, "mit")
    bench.buses["left"].drives[:] = [simulated("odrive", 1), simulated("odrive", 2)]
    ended = run("drives", "setup", "--config", str(bench.config), "--write")
    assert ended.returncode == exit_codes.UNHEALTHY and "a drive of type odrive answers" in ended.stderr
    assert all(frame.is_remote for frame in bench.buses["left"].sent)


def test_the_exit_status_says_what_still_differs_after_writing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`motor.Kv` is never written."""
    bench = Bench(folder, "moteus", monkeypatch, torque_constant_nm_a=0.1)
    ended = run("drives", "setup", "--config", str(bench.config), "--write", "--backup", "old.toml")
    assert ended.stdout.count("it has the new settings") == 4 and "4 settings differ, 0 were not read" in ended.stdout
    assert ended.returncode == exit_codes.UNHEALTHY


def test_what_cannot_be_read_is_not_restored(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    config = ("--config", str(bench.config))
    run("drives", "setup", *config, "--write", "--backup", "old.toml")
    (folder / "flat_endpoints.json").unlink()
    ended = run("drives", "setup", *config, "--restore", "old.toml")
    assert ended.returncode == exit_codes.UNHEALTHY and "name the flat_endpoints.json of firmware" in ended.stderr


def test_a_file_of_another_drive_is_not_restored(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    config = ("--config", str(bench.config))
    run("drives", "setup", *config, "--write", "--backup", "old.toml")
    text = (folder / "old.toml").read_text(encoding="utf-8")
    (folder / "old.toml").write_text(text.replace("0badcafe", "12345678"), encoding="utf-8")
    ended = run("drives", "setup", *config, "--restore", "old.toml")
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
        ("setup --endpoints bad.json", "no JSON"),
        ("setup --endpoints other.json", "no flat_endpoints.json"),
        ("setup --restore other.json", "other.json"),
        ("setup --restore empty.toml", "empty.toml"),
    ],
)
def test_a_wrong_argument_is_refused_before_anything_is_written(
    folder: Path, monkeypatch: pytest.MonkeyPatch, arguments: str, named: str
) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    (folder / "bad.json").write_text("{", encoding="utf-8")
    (folder / "other.json").write_text('{"a": 1}', encoding="utf-8")
    (folder / "empty.toml").touch()
    command, *others = arguments.split()
    ended = run("drives", command, "--config", str(bench.config), *others)
    assert ended.returncode == exit_codes.CONFIGURATION and named in ended.stderr and "Traceback" not in ended.stderr


def test_without_the_numbers_of_the_build_the_watchdog_of_the_configuration_is_read(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    (folder / "flat_endpoints.json").unlink()
    ended = run("drives", "setup", "left_sweep", "--config", str(bench.config))
    assert "2 settings differ, 11 were not read" in ended.stdout
    assert "flat_endpoints.json of firmware 0.6.11, hardware 0.0.0" in ended.stdout


@pytest.mark.parametrize("command", ["find", "setup --write", "zero left_sweep --yes"])
def test_a_bus_that_the_daemon_commands_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    bench = make_bench(folder, monkeypatch, "odrive")
    with lock_buses(load_configuration(bench.config).bus, BusRole.COMMANDS):
        ended = run("drives", *command.split(), "--config", str(bench.config))
    assert ended.returncode == exit_codes.UNHEALTHY and "systemctl stop mudskipper" in ended.stderr
    assert not any(bus.sent for bus in bench.buses.values())


def test_firmware_0_5_is_found_and_named_as_not_settable(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(folder, monkeypatch, "odrive05")
    ended = run("drives", "setup", "--config", str(bench.config), "--write")
    assert ended.stdout.count("odrivetool") == 4 and not list(folder.glob("drives-*.toml"))


def test_a_cubemars_can_neither_be_read_nor_written(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(folder, "mit", monkeypatch, model="AK80-9")
    text = bench.config.read_text(encoding="utf-8").replace('type = "mit"', 'type = "mit"\nmodel = "AK80-9"')
    bench.config.write_text(calibrated(text), encoding="utf-8")  # the record of another model would be refused
    ended = run("drives", "setup", "--config", str(bench.config))
    assert ended.stdout.count("neither read nor written") == 4
