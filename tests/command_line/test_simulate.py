"""`mudskipper simulate` gets the requested ground, and refuses wrong options before anything starts."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

import mudskipper
from command_line import exit_codes
from command_line.main import main
from drivers.can.bus_lock import BusRole
from firmware_host.buses import lock_buses
from firmware_host.configuration.loading import load_configuration, parse_configuration
from operator_client import default_paths
from simulation.body.plant import END_STOPS_RAD
from simulation.harness import peer
from simulation.harness.blocks import RESTING_RAD
from simulation.harness.drive_presets import calibrated
from simulation.harness.local_setup import configuration_text, named_folder, write_local_setup
from tests.folders import ROOT

WORLD = "[[segment]]\nstart_m = 0\nend_m = 1\nstrength_pa = 2000\n"


class StillPeer(peer.Peer):
    """A simulated robot that ends as soon as it has begun."""

    made: list[StillPeer] = []

    def __init__(self, *arguments: object) -> None:
        super().__init__(*arguments)  # type: ignore[arg-type]
        self.ended = True
        self.made.append(self)


@pytest.fixture
def world(tmp_path: Path) -> Path:
    path = tmp_path / "world.toml"
    path.write_text(WORLD, encoding="utf-8")
    return path


@pytest.fixture
def peers(monkeypatch: pytest.MonkeyPatch) -> list[StillPeer]:
    monkeypatch.setattr(peer, "Peer", StillPeer)
    monkeypatch.setattr(peer, "take_precedence", lambda: None)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr(StillPeer, "made", [])
    return StillPeer.made


def test_a_world_is_simulated_as_it_is_written(short_folder: Path, world: Path, peers: list[StillPeer]) -> None:
    encoder_and_watchdog = "[drives]\nencoder_counts = 4096\nwatchdog_s = 0.5\n"
    extra = f"[robot]\nbody_mass_kg = 3.0\n{encoder_and_watchdog}[disturbances]\nclinging_n = 0.5\n"
    world.write_text(WORLD + extra, encoding="utf-8")
    setup = write_local_setup(short_folder, short_folder)
    assert main(["simulate", "--config", str(setup), "--world", str(world)]) == exit_codes.OK
    (simulated,) = peers
    plant, drives = simulated.robot.plant, simulated.robot.drives
    assert [segment.ground.name for segment in plant.track.segments] == ["2000 Pa"]
    assert (plant.parameters.body_mass_kg, plant.parameters.disturbances.clinging_n) == (3.0, 0.5)
    assert {drive.parameters.encoder_counts for drive in drives} == {4096}
    assert {drive.parameters.watchdog_s for drive in drives} == {0.5}


@pytest.mark.parametrize(
    ("arguments", "names"), [((), ["48.5", "53.1", "45.3"]), (("--mud", "53.1", "--mud", "48.5"), ["53.1", "48.5"])]
)
def test_without_a_world_there_are_the_paper_s_muds(
    short_folder: Path, peers: list[StillPeer], arguments: tuple[str, ...], names: list[str]
) -> None:
    setup = write_local_setup(short_folder, short_folder)
    assert main(["simulate", "--config", str(setup), *arguments]) == exit_codes.OK
    assert [segment.ground.name for segment in peers[0].robot.plant.track.segments] == names
    assert {drive.parameters.watchdog_s for drive in peers[0].robot.drives} == {peer.WATCHDOG_S}


def test_a_configuration_for_a_single_flipper_gets_a_robot_whose_base_is_fixed(
    short_folder: Path, peers: list[StillPeer]
) -> None:
    setup = write_local_setup(short_folder, short_folder)
    setup.write_text(setup.read_text(encoding="utf-8") + "[estimation]\nfixed_base = true\n", encoding="utf-8")
    assert main(["simulate", "--config", str(setup)]) == exit_codes.OK
    assert peers[0].robot.plant.parameters.fixed_base


def test_on_blocks_the_flippers_lie_in_reach_of_no_mud(short_folder: Path, peers: list[StillPeer]) -> None:
    setup = write_local_setup(short_folder, short_folder)
    assert main(["simulate", "--config", str(setup), "--on-blocks"]) == exit_codes.OK
    plant = peers[0].robot.plant
    assert plant.parameters.fixed_base
    assert plant.angles_rad == pytest.approx((0.0, RESTING_RAD, 0.0, RESTING_RAD))


def test_an_operator_moves_the_flippers_back_and_presses_the_emergency_stop(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class HandedPeer(peer.Peer):
        """A simulated robot with its joints at their stops; it runs for one step."""

        def run(self) -> None:
            for arm in self.robot.plant.arms:
                arm.sweep_rad, arm.adduction_rad = END_STOPS_RAD
            for option in ("--reset", "--emergency-stop"):
                assert main(["simulate", option, "--config", str(short_folder / "mudskipper.toml")]) == exit_codes.OK
            self._pose.step = lambda now_s, plant: self.end(0, None)  # type: ignore[method-assign]
            super().run()
            powered.append(self.robot.powered)
            lying.extend((arm.sweep_rad, arm.adduction_rad) for arm in self.robot.plant.arms)

    lying: list[tuple[float, float]] = []
    powered: list[bool] = []
    monkeypatch.setattr(peer, "take_precedence", lambda: None)
    monkeypatch.setattr(peer, "Peer", HandedPeer)
    before = {
        number: signal.getsignal(number) for number in (signal.SIGUSR1, signal.SIGUSR2, signal.SIGTERM, signal.SIGINT)
    }
    try:
        assert main(["simulate", "--config", str(write_local_setup(short_folder, short_folder))]) == exit_codes.OK
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert powered == [False]
    assert len(lying) == 2 and all(abs(sweep) < 0.05 and abs(adduction) < 0.5 for sweep, adduction in lying)


def test_any_configuration_is_simulated_on_local_buses(
    short_folder: Path, peers: list[StillPeer], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(short_folder))
    monkeypatch.chdir(short_folder)
    text = (ROOT / "systemd" / "mudskipper.toml").read_text(encoding="utf-8")
    text = text.replace("[status]", '[status]\ndrive_group = "nobody-here"') + "[bus.left.options]\nfd = false\n"
    text += '[emergency_stop]\nsource = "gpio"\ndevice = "/dev/gpiochip0"\n'
    Path("robot.toml").write_text(text.replace('"socketcan"', '"kvaser"'), encoding="utf-8")
    assert main(["simulate", "--config", "robot.toml", "--local"]) == exit_codes.OK
    path = named_folder(default_paths.SIMULATED) / "mudskipper.toml"
    assert f"mudskipperd --config {path}" in capsys.readouterr().out
    local, robot = load_configuration(path), parse_configuration(calibrated(text))
    assert {bus.interface for bus in local.bus.values()} == {"mudskipper_local"} and not local.emergency_stop.source
    assert (local.drive, local.geometry, local.gait) == (robot.drive, robot.geometry, robot.gait)
    assert main(["simulate", "--reset"]) == exit_codes.UNHEALTHY  # it has ended
    assert main(["simulate", "--local"]) == exit_codes.USAGE


@pytest.mark.parametrize("command", ["simulate", "demo"])
def test_a_world_that_cannot_be_is_refused_before_anything_starts(
    command: str, tmp_path: Path, world: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    world.write_text(WORLD.replace("2000", "-1"), encoding="utf-8")
    assert main([command, "--world", str(world)]) == exit_codes.CONFIGURATION
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "segment 1.strength_pa = -1" in printed.err
    assert list(tmp_path.iterdir()) == [world]


def test_a_second_simulated_robot_leaves_the_first_one_and_its_files_alone(
    short_folder: Path, peers: list[StillPeer], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(short_folder))
    locks = lock_buses(parse_configuration(configuration_text(named_folder("twice"), Path())).bus, BusRole.DRIVES)
    assert main(["simulate", "--bus", "twice"]) == 1
    printed = capsys.readouterr()
    assert printed.out == "" and f"process {os.getpid()} simulates" in printed.err
    assert "--bus" in printed.err and "--local" not in printed.err
    assert not (named_folder("twice") / "mudskipper.toml").exists()
    locks.close()
    assert main(["simulate", "--bus", "twice"]) == exit_codes.OK
    assert "mudskipperd --config" in capsys.readouterr().out
    assert main(["simulate"]) == exit_codes.OK
    folders = [load_configuration(named_folder(bus) / "mudskipper.toml").log.directory for bus in ("robot", "twice")]
    assert [Path(folder).name for folder in folders] == ["mudskipper-simulated", "mudskipper-simulated-twice"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root makes files that are another user's")
def test_root_does_not_follow_what_another_user_prepared_among_the_temporary_files(
    tmp_path: Path, short_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    precious = tmp_path / "precious"
    precious.write_text("root's", encoding="utf-8")
    prepared = short_folder / "mudskipper-0" / "robot"
    prepared.mkdir(parents=True)
    (prepared / "mudskipper.toml").symlink_to(precious)
    for path in (prepared.parent, prepared):
        os.chown(path, 54321, 54321)
    monkeypatch.setattr("drivers.can.run_folder._runtime_parents", list)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(short_folder))

    def begin(configuration: object, ground: object, seed: int, announce: Callable[[], None]) -> int:
        announce()
        return exit_codes.OK

    monkeypatch.setattr(peer, "simulate", begin)
    monkeypatch.chdir(tmp_path)
    assert main(["simulate"]) == exit_codes.OK
    assert precious.read_text(encoding="utf-8") == "root's"


def test_a_second_terminal_or_program_finds_the_simulated_robot_where_no_service_runs(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runtime, service = short_folder / "run", short_folder / "service.sock"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(runtime))
    monkeypatch.delenv("MUDSKIPPER_SOCKET", raising=False)
    monkeypatch.setattr(default_paths, "DEFAULT_SOCKET", str(service))
    assert default_paths.default_socket() == str(service)
    simulated = named_folder(default_paths.SIMULATED) / "mudskipper.sock"
    monkeypatch.setattr(default_paths, "DEFAULT_SOCKET", str(short_folder / "mudskipper.sock"))
    simulated.touch()
    assert default_paths.default_socket() == str(simulated)
    with pytest.raises(mudskipper.NoDaemonError, match=str(simulated)):
        mudskipper.Client()
    (short_folder / "mudskipper.sock").touch()  # the socket of the service
    assert default_paths.default_socket() == str(short_folder / "mudskipper.sock")
    monkeypatch.setenv("MUDSKIPPER_SOCKET", "/given")
    assert default_paths.default_socket() == "/given"


def test_a_robot_on_its_own_buses_needs_no_folder_of_the_user(
    short_folder: Path, peers: list[StillPeer], monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(name: str) -> Path:
        raise OSError(f"no folder for {name}")

    setup = write_local_setup(short_folder, short_folder)
    monkeypatch.setattr("command_line.simulate.named_folder", none)
    assert main(["simulate", "--config", str(setup)]) == exit_codes.OK and len(peers) == 1
