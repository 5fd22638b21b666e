"""The bench's stages on one rig: opened once, each stage only after the one before it, idle whatever happens.

pytest tests/bench --can can0             a robot, asked before it moves
pytest tests/bench --config FILE          the same on the interfaces of the configuration
pytest tests/bench --simulated            a simulated robot, as fast as it computes
"""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from experiments.bench.channels import on_channels
from experiments.bench.operator import AbsentAttendant, AskedAttendant, Attendant, SimulatedAttendant
from experiments.bench.rig import HardwareRig, Rig, SimulatedRig
from experiments.bench.test_rig import Stand
from experiments.robot.bench_robot import BenchError
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.toml_records import ConfigurationError
from simulation.body.blocks import resting_drop_m
from tests.bench.staged_bench import (
    SKIPPED,
    BenchReport,
    StagedBench,
    UncapturedOperator,
    reported_of_file,
    stage_name,
    stage_of,
)
from tests.folders import EXAMPLE_CONFIGURATION

INSTALLED = Path("/etc/mudskipper/mudskipper.toml")
EXAMPLE = EXAMPLE_CONFIGURATION
REPORT = pytest.StashKey[BenchReport]()
NOT_ASKED_FOR = "needs a robot (--can CHANNEL, or --config FILE) or --simulated"


def pytest_configure(config: pytest.Config) -> None:
    config.stash[REPORT] = BenchReport()


def report_of(config: pytest.Config) -> BenchReport:
    """This file may have been found only after pytest was configured."""
    return config.stash.setdefault(REPORT, BenchReport())


@pytest.fixture(scope="session")
def opened(request: pytest.FixtureRequest) -> Iterator[Stand | str]:
    """The stand, or why there is none."""
    options, robot = request.config.option, report_of(request.config).robot
    if not (options.simulated or options.can or options.config):
        pytest.skip(NOT_ASKED_FOR)
    path = Path(options.config) if options.config else configuration_path(options.simulated)
    kind = "simulated" if options.simulated else "hardware"
    stamp = datetime.now(UTC).isoformat(timespec="seconds")
    robot |= {"rig": kind, "begun": stamp, "configuration": str(path), "warnings": []}
    try:
        configuration = load_configuration(path)
        rig, attendant = open_rig(request.config, on_channels(configuration, options.can or []))
    except (ConfigurationError, BenchError) as problem:
        yield reported_of_file(path, problem.problems) if isinstance(problem, ConfigurationError) else str(problem)
        return
    robot |= {"robot": configuration.robot.name, "warnings": list(rig.warnings)}
    stand = Stand(rig, attendant)
    try:
        yield stand
    finally:
        stand.end()
        rig.close()
        robot["lateness"] = vars(stand.lateness_so_far)


def configuration_path(simulated: bool) -> Path:
    return INSTALLED if INSTALLED.exists() and not simulated else EXAMPLE


def open_rig(config: pytest.Config, configuration: Configuration) -> tuple[Rig, Attendant]:
    """Raises BenchError."""
    if config.option.simulated:
        simulated = SimulatedRig(configuration)
        return simulated, SimulatedAttendant(simulated)
    attendant = attendant_at(config)
    return HardwareRig(configuration), attendant


def attendant_at(config: pytest.Config) -> Attendant:
    """Raises BenchError where nobody can be asked and nobody has said yes beforehand."""
    capture = config.pluginmanager.getplugin("capturemanager")
    if capture is not None:
        capture.suspend(in_=True)
    somebody = sys.stdin is not None and sys.stdin.isatty()
    if capture is not None:
        capture.resume()
    if somebody:
        return AskedAttendant(UncapturedOperator(config), config.option.yes)
    if config.option.yes:
        return AbsentAttendant()
    raise BenchError("The robot will move, and nobody can be asked: run this on a terminal, or with --yes.")


@pytest.fixture
def bench(request: pytest.FixtureRequest, opened: Stand | str) -> Iterator[StagedBench]:
    report, stage = report_of(request.config), stage_of(request.path)
    report.begin(stage, request.node.name)
    moves = getattr(request.module, "MOVES", "")
    obstacle = report.obstacle(stage) or (moves and report.stumble(stage, request.node.name))
    if obstacle:
        pytest.skip(obstacle)
    if isinstance(opened, str):
        if report.tests:
            pytest.skip("the bench did not open")
        pytest.fail(opened, pytrace=False)
    if moves:
        ask_before_moving(moves, opened, report, stage)
    yield StagedBench(opened, report)
    try:
        opened.let_go()
    except BenchError as problem:
        opened.end()
        report.out_of_hand = str(problem)
        pytest.fail(report.out_of_hand, pytrace=False)


def ask_before_moving(what: str, stand: Stand, report: BenchReport, stage: int) -> None:
    """Once for each stage that moves something, whatever the answer."""
    if stage not in report.consents:
        report.consents[stage] = False  # where no answer comes
        report.consents[stage] = lets_move(what, stand, stage)
    if not report.consents[stage]:
        pytest.skip("a person did not want the robot to move")


def lets_move(what: str, stand: Stand, stage: int) -> bool:
    lying_cm = 100.0 * resting_drop_m(stand.configuration.geometry)
    where = (
        f"The robot stands on blocks; idle, its flippers lie on something soft, {lying_cm:.0f} cm below their axes."
        " Nobody's hands are near them, and the power switch is at hand."
    )
    return stand.attendant.consents(f"{stage_name(stage).capitalize()}: {what}\n{where}", stand.look_on)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """What ends a measurement is a sentence for people, not a traceback."""
    try:
        return (yield)
    except BenchError as problem:
        reported = str(problem)
    pytest.fail(reported, pytrace=False)  # out here pytest tells it once


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    reported = yield
    if reported.when == "teardown" or not reported.passed:
        report = report_of(item.config)
        report.worsen(reported.outcome, why_of(reported))
        if reported.when == "teardown":
            report.end()
    return reported


def why_of(reported: pytest.TestReport) -> str:
    """Of one that was skipped, pytest has a place before its reason, which begins with a word of pytest's own."""
    return (
        reported.longrepr[2].removeprefix("Skipped: ")
        if isinstance(reported.longrepr, tuple)
        else reported.longreprtext
    )


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    report, path = report_of(config), config.option.bench_report
    if not report.robot:
        return
    report.worsen(SKIPPED, "interrupted")  # a test that is still under way
    report.end()
    terminalreporter.section("bench")
    terminalreporter.write_line(f"{report.robot['rig']}, configuration {report.robot['configuration']}")
    for line, good in report.lines(brief=config.get_verbosity() < 0):
        terminalreporter.write_line(line, **({} if good else {"red": True}))
    for warning in report.robot["warnings"]:
        terminalreporter.write_line(f"warning: {warning}")
    late = report.robot.get("lateness")
    if late and late["ticks"]:
        seen = f"{late['missed']} of {late['ticks']} ticks missed, messages up to {1e3 * late['oldest_s']:.0f} ms old"
        terminalreporter.write_line(f"with torque on: {seen}")
    if path:
        try:
            report.write(Path(path))
        except OSError as problem:
            terminalreporter.write_line(f"the report was not written to {path}: {problem.strerror}", red=True)
