"""Fixtures that tests of several layers share."""

import gc
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import parse_configuration
from simulation.harness.drive_presets import calibrated
from simulation.harness.lockstep import Lockstep
from tests.folders import EXAMPLE_CONFIGURATION
from tests.recorded_walks import record_walks
from tests.running_bench import Bench, SharedBench, running_bench

# No time counts, as the machine may be busy; the same examples for each commit; `--hypothesis-profile` chooses others.
TIMELESS = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("search", TIMELESS)
settings.register_profile("long", TIMELESS, max_examples=10_000)
settings.register_profile("repeatable", TIMELESS, derandomize=True, max_examples=50)
settings.load_profile("repeatable")

signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job starts with it ignored, and so its children


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the bench (tests/bench) here, because pytest reads options before it loads that folder."""
    bench = parser.getgroup("bench", "the robot's bench: tests/bench")
    bench.addoption("--simulated", action="store_true", help="on a simulated robot, as fast as it computes")
    bench.addoption(
        "--can", action="append", metavar="[NAME=]CHANNEL", help="on a robot: SocketCAN channel of all buses, or of one"
    )
    bench.addoption("--config", metavar="FILE", help="the robot's configuration, and its CAN interfaces without --can")
    bench.addoption("--yes", action="store_true", help="do not ask before the robot moves")
    bench.addoption("--bench-report", metavar="PATH", help="write every figure of the bench there, as JSON")


def pytest_configure(config: pytest.Config) -> None:
    if config.option.simulated and config.option.can:
        raise pytest.UsageError("--simulated needs no --can: choose one of them")


def pytest_collection_finish() -> None:
    """Leave what the tests and libraries consist of out of every collection of garbage, a million objects, and collect
    rarely: a simulated walk makes many records and few cycles.
    """
    gc.freeze()
    gc.set_threshold(100_000)


@pytest.fixture(scope="session")
def example_text() -> str:
    """Returns the text of the example configuration."""
    return EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def configuration() -> Configuration:
    """Return the example's configuration, of a robot that is simulated."""
    return parse_configuration(calibrated(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8")))


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """Yield a folder with a path short enough for a Unix socket."""
    with tempfile.TemporaryDirectory(prefix="mud-") as folder:
        yield Path(folder)


@pytest.fixture(scope="module")
def png_alone() -> Iterator[None]:
    """Write pictures as PNG alone, for tests that need a page and not all of its files."""
    from experiments.study import page  # slow to import

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "ENDINGS", (".png",))
        yield


@pytest.fixture(scope="session")
def walked_twice(tmp_path_factory: pytest.TempPathFactory, configuration: Configuration) -> tuple[Path, Lockstep]:
    """Record a log in which the robot walks two strides, holds, and walks one more; return it and the robot."""
    path = tmp_path_factory.mktemp("logs") / "two.mcap"
    return path, record_walks(path, configuration, 2, 1)


@pytest.fixture(scope="session")
def two_walks(walked_twice: tuple[Path, Lockstep]) -> Path:
    return walked_twice[0]


@pytest.fixture(scope="session")
def shared_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SharedBench]:
    shared = SharedBench(tmp_path_factory)
    yield shared
    shared.end()


@pytest.fixture
def bench(shared_bench: SharedBench) -> Bench:
    """Return a robot at rest that many tests share; a test must leave both processes running."""
    made = shared_bench.start()
    made.reset()
    return made


@pytest.fixture
def own_bench(shared_bench: SharedBench, tmp_path: Path) -> Iterator[Bench]:
    """Yield a robot whose processes the test may end."""
    shared_bench.end()
    with running_bench(tmp_path / "logs") as made:
        yield made
