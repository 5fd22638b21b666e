"""The stages of the bench share one rig, opened once; each stage needs the one before it; the drives always end idle.

pytest tests/bench --can can0             a robot, asked before it moves
pytest tests/bench --config FILE          the same on the interfaces of the configuration
pytest tests/bench --simulated            a simulated robot, as fast as it computes
"""

import sys
from collections.abc import Generator, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from experiments.bench.operator import BenchOperator
from experiments.bench.rig import HardwareRig, Rig, SimulatedRig, on_channels
from experiments.bench.simulated_hand import simulated_operator
from experiments.bench.test_rig import TestRig
from experiments.robot.bench_errors import BenchError
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.service_file import service_configuration
from simulation.harness.blocks import resting_drop_m
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

REPORT = pytest.StashKey[BenchReport]()
NOT_ASKED_FOR = "needs a robot (--can CHANNEL, or --config FILE) or --simulated"


def pytest_configure(config: pytest.Config) -> None:
    config.stash[REPORT] = BenchReport()


def report_of(config: pytest.Config) -> BenchReport:
    """Return the report, which is new if this file was found only after pytest was configured."""
    return config.stash.setdefault(REPORT, BenchReport())


@pytest.fixture(scope="session")
def opened(request: pytest.FixtureRequest) -> Iterator[TestRig | str]:
    """Yield the test rig, or the reason why there is none."""
    options, robot = request.config.option, report_of(request.config).robot
    if not (options.simulated or options.can or options.config):
        pytest.skip(NOT_ASKED_FOR)
    installed = service_configuration()
    usual = installed if installed.exists() and not options.simulated else EXAMPLE_CONFIGURATION
    path = Path(options.config) if options.config else usual
    kind = "simulated" if options.simulated else "hardware"
    stamp = datetime.now(UTC).isoformat(timespec="seconds")
    robot |= {"rig": kind, "begun": stamp, "configuration": str(path), "warnings": []}
    try:
        configuration = load_configuration(path)
        configuration = on_channels(configuration, options.can or [])
        bench_operator = None if options.simulated else operator_at(request.config)
        rig: Rig = SimulatedRig(configuration) if options.simulated else HardwareRig(configuration)
    except (ConfigurationError, BenchError) as problem:
        yield reported_of_file(path, problem.problems) if isinstance(problem, ConfigurationError) else str(problem)
        return
    robot |= {"robot": configuration.robot.name, "warnings": list(rig.warnings)}
    if isinstance(rig, SimulatedRig):
        bench_operator = simulated_operator(rig)
    assert bench_operator is not None
    with TestRig(rig, bench_operator) as test_rig:
        try:
            yield test_rig
        finally:
            robot["lateness"] = vars(test_rig.lateness_so_far)


def operator_at(config: pytest.Config) -> BenchOperator:
    """Return the operator. Raises BenchError where there is no terminal and no --yes."""
    capture = config.pluginmanager.getplugin("capturemanager")
    if capture is not None:
        capture.suspend(in_=True)
    has_terminal = sys.stdin is not None and sys.stdin.isatty()
    if capture is not None:
        capture.resume()
    if has_terminal:
        return BenchOperator(UncapturedOperator(config), sure=config.option.yes)
    if config.option.yes:
        return BenchOperator()
    raise BenchError(
        "The robot will move, and there is no terminal to ask for permission: run this on a terminal, or with --yes."
    )


@pytest.fixture
def bench(request: pytest.FixtureRequest, opened: TestRig | str) -> Iterator[StagedBench]:
    report, stage = report_of(request.config), stage_of(request.path)
    joint = request.getfixturevalue("joint") if "joint" in request.fixturenames else ""
    if joint and isinstance(opened, TestRig) and joint not in opened.configuration.rig.joints:
        pytest.skip(f"this rig has no {joint}")  # which is no part of the report
    report.begin(stage, request.node.name)
    moves = getattr(request.module, "MOVES", "")
    obstacle = report.obstacle(stage) or (moves and report.own_obstacle(stage, request.node.name))
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
        opened.switch_off()
    except BenchError as problem:
        opened.force_idle()
        report.keeps_torque = str(problem)
        pytest.fail(report.keeps_torque, pytrace=False)


def ask_before_moving(what: str, test_rig: TestRig, report: BenchReport, stage: int) -> None:
    """Ask only once for each stage that moves something, also if the operator refuses."""
    if stage not in report.consents:
        report.consents[stage] = False  # in case no answer comes
        lying_cm = 100.0 * resting_drop_m(test_rig.configuration.geometry)
        question = (
            f"{stage_name(stage).capitalize()}: {what}\nThe robot stands on blocks; idle, its flippers lie on something"
            f" soft, {lying_cm:.0f} cm below their axes. Nobody's hands are near them, and the power switch is at hand."
        )
        report.consents[stage] = test_rig.operator.allows_motion(question, test_rig.run_during_prompt)
    if not report.consents[stage]:
        pytest.skip("the operator did not allow motion")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Turn a BenchError into a message without a traceback."""
    try:
        return (yield)
    except BenchError as problem:
        reported = str(problem)
    pytest.fail(reported, pytrace=False)  # outside of the handler, so that pytest prints it once


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    reported = yield
    if reported.when == "teardown" or not reported.passed:
        report = report_of(item.config)
        why = reported.longreprtext
        if isinstance(reported.longrepr, tuple):  # pytest puts a location and a prefix before why a test was skipped
            why = reported.longrepr[2].removeprefix("Skipped: ")
        report.worsen(reported.outcome, why)
        if reported.when == "teardown":
            report.end()
    return reported


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
    for joint, key in report.robot.get("proven_watchdogs", {}).items():
        terminalreporter.write_line(f"to arm without --force, write under [drive.{joint}]:\n{key}")
    late = report.robot.get("lateness")
    if late and late["ticks"]:
        seen = f"{late['missed']} of {late['ticks']} ticks missed, messages up to {1e3 * late['oldest_s']:.0f} ms old"
        terminalreporter.write_line(f"with torque on: {seen}")
    if path:
        try:
            report.write(Path(path))
        except OSError as problem:
            terminalreporter.write_line(f"the report was not written to {path}: {problem.strerror}", red=True)
