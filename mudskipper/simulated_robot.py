"""Starts a simulated robot and its daemon for a program of one's own."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import tomlkit

from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import read_text
from mudskipper.client import POLL_S, Client
from mudskipper.ground_and_gait import World, ground_of
from simulation.harness.local_robot import LocalRobot
from simulation.harness.local_setup import local_copy

READY_S = 30.0


@contextmanager
def simulate(world: World | None = None, robot: str | Path | None = None, seed: int = 1) -> Iterator[Client]:
    """Yield a Client of a simulated robot that is ready to arm, in real time; end its processes in any case.

    `world` is a Ground, a world file or its tables (default: three muds), `robot` the configuration of a robot, without
    its buses and logs. Everything is in a temporary folder. Raises ConfigurationError and NoDaemonError.

    >>> from mudskipper import Ground, simulate
    >>> with simulate(Ground(strength_pa=500.0)) as client:
    ...     client.arm()
    ...     client.wait_for("hold")["mode"]
    'hold'
    """
    with TemporaryDirectory(prefix="mudskipper-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        logs, text = folder / "logs", ""
        if robot is not None:
            text = read_text(Path(robot))
            parse_configuration(text, Path(robot))  # names the keys of the file itself
            text = local_copy(text, folder, logs)
        processes = LocalRobot(folder, logs, seed, _world_file(world, folder), text)
        try:
            with ready_client(processes) as client:
                yield client
        finally:
            processes.end()


@contextmanager
def ready_client(processes: LocalRobot) -> Iterator[Client]:
    """Yield a Client once the robot is ready to arm. Raises NoDaemonError and TimeoutError."""
    processes.connect().close()
    with Client(processes.socket) as client:
        deadline_s = time.monotonic() + READY_S
        while (report := client.status())["mode"] != "idle" or report["fault"]:
            processes.check_processes()
            if time.monotonic() > deadline_s:
                why = report["fault"]["message"] if report["fault"] else f"it is in mode {report['mode']}"
                raise TimeoutError(f"the simulated robot is not ready after {READY_S:g} s: {why}")
            time.sleep(POLL_S)
        yield client


def _world_file(world: World | None, folder: Path) -> Path | None:
    """Return the checked file of a world. Raises ConfigurationError."""
    if world is None:
        return None
    path = folder / "world.toml"
    path.write_text(tomlkit.dumps(ground_of(world).tables), encoding="utf-8")
    return path
