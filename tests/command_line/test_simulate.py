"""`mudskipper simulate` gets the requested ground, and refuses wrong options before anything starts."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

import mudskipper
from drivers.can.bus_lock import BusRole
from firmware_host.buses import lock_buses
from firmware_host.configuration.loading import load_configuration, parse_configuration
from operator_client import default_paths
from simulation.body.plant import END_STOPS_RAD
from simulation.harness import peer
from simulation.harness.blocks import RESTING_RAD
from simulation.harness.drive_presets import calibrated
from simulation.harness.local_setup import configuration_text, named_folder, write_local_setup
from simulation.harness.robot import SimulatedRobot
from tests.command_line.command_lines import failure, output
from tests.folders import ROOT

Simulate = Callable[..., SimulatedRobot]


@pytest.fixture
def robots(monkeypatch: pytest.MonkeyPatch) -> list[SimulatedRobot]:
    """Return the list of the simulated robots, each of which ends as soon as it has begun."""
    made: list[SimulatedRobot] = []

    def run(ending: peer.Peer) -> None:
        made.append(ending.robot)
        ending.close()

    monkeypatch.setattr(peer.Peer, "run", run)
    monkeypatch.setattr(peer, "take_precedence", lambda cpu: None)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    return made


@pytest.fixture
def simulate(short_folder: Path, robots: list[SimulatedRobot], monkeypatch: pytest.MonkeyPatch) -> Simulate:
    """Return a function that simulates a robot on the buses of its configuration, for a user without a folder."""

    def no_folder(name: str) -> Path:
        raise OSError(f"no folder for {name}")

    monkeypatch.setattr("command_line.simulate.named_folder", no_folder)
    setup = write_local_setup(short_folder, short_folder)

    def simulate(*options: str, configured: str = "") -> SimulatedRobot:
        setup.write_text(setup.read_text(encoding="utf-8") + configured, encoding="utf-8")
        output("simulate", "--config", str(setup), *options)
        return robots[-1]

    return simulate


def test_a_world_is_simulated_as_it_is_written(simulate: Simulate, tmp_path: Path) -> None:
    world = tmp_path / "world.toml"
    world.write_text(
        "[[segment]]\nstart_m = 0\nend_m = 1\nstrength_pa = 2000\n[robot]\nbody_mass_kg = 3.0\n"
        "[drives]\nencoder_counts = 4096\nwatchdog_s = 0.5\n[disturbances]\nclinging_n = 0.5\n",
        encoding="utf-8",
    )
    robot = simulate("--world", str(world))
    plant = robot.plant
    assert [segment.ground.name for segment in plant.track.segments] == ["2000 Pa"]
    assert (plant.parameters.body_mass_kg, plant.parameters.disturbances.clinging_n) == (3.0, 0.5)
    parameters = [drive.parameters for drive in robot.drives]
    assert {(each.encoder_counts, each.watchdog_s) for each in parameters} == {(4096, 0.5)}


@pytest.mark.parametrize(
    ("options", "names"), [((), ["48.5", "53.1", "45.3"]), (("--mud", "53.1", "--mud", "48.5"), ["53.1", "48.5"])]
)
def test_without_a_world_there_are_the_paper_s_muds(
    simulate: Simulate, options: tuple[str, ...], names: list[str]
) -> None:
    robot = simulate(*options)
    assert [segment.ground.name for segment in robot.plant.track.segments] == names
    assert {drive.parameters.watchdog_s for drive in robot.drives} == {peer.WATCHDOG_S}


def test_a_configuration_for_a_single_flipper_gets_a_robot_whose_base_is_fixed(simulate: Simulate) -> None:
    assert simulate(configured="[estimation]\nfixed_base = true\n").plant.parameters.fixed_base


def test_on_blocks_the_flippers_lie_in_reach_of_no_mud(simulate: Simulate) -> None:
    plant = simulate("--on-blocks").plant
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
                output("simulate", option, "--config", setup)
            self._pose.step = lambda now_s, plant: self.end(0, None)  # type: ignore[method-assign]
            super().run()
            robots.append(self.robot)

    robots: list[SimulatedRobot] = []
    setup = str(write_local_setup(short_folder, short_folder))
    monkeypatch.setattr(peer, "take_precedence", lambda cpu: None)
    monkeypatch.setattr(peer, "Peer", HandedPeer)
    numbers = (signal.SIGUSR1, signal.SIGUSR2, signal.SIGTERM, signal.SIGINT)
    before = [signal.getsignal(number) for number in numbers]
    try:
        output("simulate", "--config", setup)
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
    (robot,) = robots
    assert not robot.powered
    assert all(abs(arm.sweep_rad) < 0.05 and abs(arm.adduction_rad) < 0.5 for arm in robot.plant.arms)


@pytest.mark.usefixtures("robots")
def test_any_configuration_is_simulated_on_local_buses(short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(short_folder))
    monkeypatch.chdir(short_folder)
    text = (ROOT / "systemd" / "mudskipper.toml").read_text(encoding="utf-8")
    text = text.replace("[status]", '[status]\ndrive_group = "nobody-here"') + "[bus.left.options]\nfd = false\n"
    text += '[emergency_stop]\nsource = "gpio"\ndevice = "/dev/gpiochip0"\n'
    Path("robot.toml").write_text(text.replace('"socketcan"', '"kvaser"'), encoding="utf-8")
    path = named_folder(default_paths.SIMULATED) / "mudskipper.toml"
    assert f"mudskipperd --config {path}" in output("simulate", "--config", "robot.toml", "--local")
    local, robot = load_configuration(path), parse_configuration(calibrated(text))
    assert {bus.interface for bus in local.bus.values()} == {"mudskipper_local"} and not local.emergency_stop.source
    assert (local.drive, local.geometry, local.gait) == (robot.drive, robot.geometry, robot.gait)
    failure("simulate", "--reset")  # it has ended


@pytest.mark.usefixtures("robots")
def test_a_second_simulated_robot_leaves_the_first_one_and_its_files_alone(
    short_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(short_folder))
    with lock_buses(parse_configuration(configuration_text(named_folder("twice"), Path())).bus, BusRole.DRIVES):
        refused = failure("simulate", "--bus", "twice")
    assert f"process {os.getpid()} simulates" in refused and "--bus" in refused and "--local" not in refused
    assert not (named_folder("twice") / "mudskipper.toml").exists()
    assert "mudskipperd --config" in output("simulate", "--bus", "twice")
    output("simulate")
    folders = [load_configuration(named_folder(bus) / "mudskipper.toml").log.directory for bus in ("robot", "twice")]
    assert [Path(folder).name for folder in folders] == ["mudskipper-simulated", "mudskipper-simulated-twice"]


@pytest.mark.usefixtures("robots")
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

    monkeypatch.chdir(tmp_path)
    output("simulate")
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
