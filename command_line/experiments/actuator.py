"""`mudskipper experiment actuator`: weights on one joint after the other, and what that says of the motors."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from command_line.commands import DEFAULT_CONFIG
from command_line.experiments.conduct import conduct_bench
from control.joint_pd import GRAVITY_M_S2
from experiments.actuator.bench import ActuatorBench, RobotBench, SimulatedBench
from experiments.actuator.configuration_change import changed_text, difference, replace_file
from experiments.actuator.fit import JointFit, fit_joint
from experiments.actuator.plan import PAPER_WEIGHTS_G, Plan
from experiments.actuator.report import TITLE, left_out, report_of, sections_of, text_of
from experiments.actuator.simulation import bench_configuration, truth_rows
from experiments.reports.report_page import Section
from experiments.reports.text_tables import text_of_tables
from experiments.robot.bench_robot import BenchError
from experiments.robot.daemon_robot import DaemonRobot
from experiments.trials.session import Ending, Finding, Session
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.loading import load_configuration
from firmware_host.configuration.toml_records import read_text

DEFAULT_JOINTS = ("right_adduction", "right_sweep")
LARGEST_UNCERTAINTY = 0.02  # of a torque constant that is written
COPY = "mudskipper.toml"
TRUTH = "The simulated motors themselves"
WRITE, LEAVE = "y", ""


def run_actuator(options: argparse.Namespace) -> int:
    return conduct_bench(options, "readings", partial(_calibrate, options))


def _calibrate(options: argparse.Namespace, session: Session) -> Finding:
    bench = _bench(options)
    try:
        target = _target(options, session, bench) if options.apply else None
        plan = _plan(options, bench.configuration)
        readings = bench.calibrate(plan, session.folder, session.operator, session.show)
    finally:
        logs = bench.leave(session.folder, session.operator)
    drives = bench.configuration.drive
    fits = [
        fit
        for joint in plan.joints
        if (fit := fit_joint(joint, plan, readings[joint], drives[joint].torque_constant_nm_a)) is not None
    ]
    applied, ending = _applied(target, fits, session) if target else ("", Ending.DONE)
    omitted = len(left_out(plan, readings))
    tables, sections = text_of(fits), sections_of(plan, readings, fits)
    if options.simulated:
        rows = truth_rows(fits)
        tables.append((TRUTH, rows))
        sections.append(Section(TRUTH, rows=rows))
    reported = [*_remarks(plan.joints, fits, omitted), *([applied] if applied else [])]
    text = "\n\n".join([text_of_tables(tables), *(["\n".join(reported)] if reported else [])])
    report = report_of(plan, readings, fits) | {"applied": applied or None}
    return Finding(report, TITLE, sections, text, logs, ending)


def _bench(options: argparse.Namespace) -> ActuatorBench:
    if options.simulated:
        configuration = load_configuration(options.config) if options.config else bench_configuration()
        return SimulatedBench(configuration, options.seed)
    return RobotBench(DaemonRobot(options.socket))


def _plan(options: argparse.Namespace, configuration: Configuration) -> Plan:
    return Plan(
        tuple(dict.fromkeys(options.joint or DEFAULT_JOINTS)),
        options.weights or PAPER_WEIGHTS_G,
        options.trials,
        options.lever_m or configuration.geometry.flipper_length_m,
        options.gravity or GRAVITY_M_S2,
        options.lever_tolerance_mm / 1000.0,
        options.weight_tolerance_percent / 100.0,
    )


def _remarks(joints: Sequence[str], fits: Sequence[JointFit], omitted: int) -> list[str]:
    fitted = {fit.joint for fit in fits}
    remarks = [f"{joint}: too little was read for a line" for joint in joints if joint not in fitted]
    remarks += [
        f"{fit.joint}: the weights pull upwards, by the sign of the current: check drive.{fit.joint}.sign"
        for fit in fits
        if fit.direction > 0 and fit.joint.endswith("adduction")
    ]
    if omitted:
        remarks.append(f"{omitted} readings are left out: see the report")
    return remarks


def _target(options: argparse.Namespace, session: Session, bench: ActuatorBench) -> Path:
    """The file that is to be changed, refused before the work where that cannot be. Raises BenchError."""
    if options.simulated:
        copy: Path = session.folder / COPY
        copy.write_text(bench.configuration.text, encoding="utf-8")
        return copy
    path: Path = options.config or Path(DEFAULT_CONFIG)
    if read_text(path) != bench.configuration.text:
        raise BenchError(f"the daemon does not run with {path}: name its file with --config, or restart it")
    if not (os.access(path, os.W_OK) and os.access(path.resolve().parent, os.W_OK)):
        raise BenchError(f"--apply: you may not write {path}; run this as who may, such as root, or without --apply")
    return path


def _applied(path: Path, fits: Sequence[JointFit], session: Session) -> tuple[str, Ending]:
    """What was done, and how the experiment ends. A file that cannot be changed costs no report."""
    try:
        return _apply(path, fits, session), Ending.DONE
    except BenchError as problem:
        return f"nothing was applied: {problem}", Ending.REFUSED


def _apply(path: Path, fits: Sequence[JointFit], session: Session) -> str:
    before = read_text(path)
    changes = {key: value for fit in fits for key, value in changes_of(fit).items()}
    for fit in fits:
        if not changes_of(fit):
            uncertainty = 100.0 * fit.constant_error_nm_a / fit.constant_nm_a
            session.operator.report(f"{fit.joint}: k_t is known to {uncertainty:.1f} % only, and is not written.")
    after = changed_text(before, changes)
    if after == before:
        return f"{path} needs no change"
    session.operator.report(difference(before, after, str(path)))
    if session.operator.ask(f"Write this to {path}?", {WRITE: "write it", LEAVE: "leave it"}, lambda: None) != WRITE:
        return f"{path} was left as it is"
    backup = replace_file(path, before, after)
    return (
        f"{path} is changed, and was kept as {backup.name}. Set odrv0.axis0.config.motor.torque_constant of the"
        " drives to the same values, then 'systemctl restart mudskipper'"
    )


def changes_of(fit: JointFit) -> dict[tuple[str, ...], float]:
    """Of the configuration's keys; nothing where the constant is too doubtful."""
    constant_nm_a, error_nm_a = fit.constant_nm_a, fit.constant_error_nm_a
    if not 0.0 < error_nm_a <= LARGEST_UNCERTAINTY * constant_nm_a:
        return {}
    changes: dict[tuple[str, ...], float] = {
        ("drive", fit.joint, "torque_constant_nm_a"): round(constant_nm_a, 5),
    }
    for name, (value, error) in (("coulomb_nm", fit.friction_nm), ("viscous_nm_s", fit.viscous_nm_s)):
        if value > 2.0 * error:  # never of what was not measured
            changes["friction", fit.joint, name] = round(value, 4)
    return changes
