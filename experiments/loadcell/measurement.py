"""The ground truth of a mud from a load cell on a linear stage (the paper's section II-E), and how a flipper compares.

A plate is dragged 20 cm through the mud at 3 cm of depth, and in other trials let down 3 cm, held for 3 s and drawn
out, at 0.1 m/s and five times each. The cell's amplifier is a serial port; nobody but its operator knows the stage.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from drivers.load_cell.calibration import (
    CalibrationError,
    LoadCellCalibration,
    calibrate,
    of_unit,
    read_calibration,
    remarks_on,
    weigh,
    write_calibration,
)
from drivers.load_cell.line_formats import COUNTS, LineFormat
from drivers.load_cell.load_cell_port import LoadCellPort
from experiments.loadcell.analysis import analyse
from experiments.loadcell.comparison import Compared, compared_with
from experiments.loadcell.fits import COEFFICIENTS, Analysed, OfMud, bench_uncertainty, of_mud, speed_remark
from experiments.loadcell.motion import StageSettings
from experiments.loadcell.raw import load_all
from experiments.loadcell.recording import CellRecorder
from experiments.loadcell.trial_checks import examine_encoder, examine_lines
from experiments.loadcell.trials import TrialBench, TrialPlan, measure_all
from experiments.robot.bench_robot import BenchError
from experiments.robot.prompt import GO_ON, Operator
from experiments.trials.notebook import Notebook
from experiments.trials.session import Show
from firmware_host.operator.reports import known

CALIBRATION = "calibration.json"
WEIGHING_S = 2.0
LEAST_SAMPLES = 12  # of an insertion
STOP = "q"


@dataclass(frozen=True)
class CellSettings:
    """As the operator gave them; an empty unit is that of the lines."""

    format_name: str = "auto"
    unit: str = ""
    scale_n: float | None = None  # newtons per unit
    calibration: Path | None = None


def plan_of_notebook(settings: StageSettings) -> dict[str, Any]:
    """What may not change between the trials of one folder; muds and trials may be added."""
    return {"experiment": "loadcell", **asdict(settings)}


def measure(bench: TrialBench, plan: TrialPlan, cell: CellSettings) -> None:
    """From an open port to all trials. Raises BenchError with what to do."""
    port = bench.recorder.port
    bench.operator.report(f"listening to {port.path} at {port.baud} baud")
    port.line_format = LineFormat(examine_lines(bench.recorder, cell.format_name))
    examine_encoder(bench.recorder, bench.operator, plan.settings)
    port.calibration = settle_calibration(bench, cell)
    on_rate(bench.recorder, bench.operator, plan.settings)
    measure_all(bench, plan)


def settle_calibration(bench: TrialBench, cell: CellSettings) -> LoadCellCalibration:
    """From the file that was given, the unit, this folder's earlier one, or made anew. Raises BenchError."""
    port = bench.recorder.port
    unit = cell.unit or _unit_of(port)
    kept = bench.folder / CALIBRATION
    try:
        if cell.calibration is not None:
            return read_calibration(cell.calibration)
        known = of_unit(unit, cell.scale_n)
        if known is not None:
            return known
        if kept.exists():
            bench.operator.report(f"calibration from {kept}; remove it to calibrate again")
            return read_calibration(kept)
    except CalibrationError as problem:
        raise BenchError(str(problem)) from problem
    return _calibrate_anew(bench, unit, kept)


def _unit_of(port: LoadCellPort) -> str:
    """As most lines say, or counts."""
    readings = [port.line_format.decode(line) for line in port.recent_lines]
    units = Counter(reading.unit for reading in readings if reading is not None and reading.unit)
    return units.most_common(1)[0][0] if units else COUNTS


def _calibrate_anew(bench: TrialBench, unit: str, kept: Path) -> LoadCellCalibration:
    """Until two weights tell the span; a person is told what is wrong and asked for other ones."""
    recorder = bench.recorder
    recorder.port.calibration = LoadCellCalibration(unit, 1.0)
    while True:
        try:
            weighings = [weigh(bench.stage.weigh(which), _readings(recorder)) for which in (0, 1)]
            calibration = calibrate(unit, *weighings)
        except CalibrationError as problem:
            bench.operator.report(str(problem))
            if bench.operator.ask("Calibrate again?", {GO_ON: "yes", STOP: "stop"}, recorder.drain) == STOP:
                raise BenchError("the load cell is not calibrated") from problem
            continue
        for remark in remarks_on(calibration, *weighings):
            bench.operator.report(remark)
        write_calibration(kept, calibration)
        bench.operator.report(
            f"calibrated: {calibration.per_newton:.6g} {unit} per N, ± {100.0 * calibration.relative_error:.2g} %; "
            f"kept in {kept}"
        )
        return calibration


def _readings(recorder: CellRecorder) -> list[float]:
    """Raises CalibrationError where the cell cannot bear the weight."""
    recorder.drain()
    samples = recorder.listen(WEIGHING_S)
    readings = [sample.force_n for sample in samples if not sample.overloaded]
    if len(readings) < len(samples) / 2.0:
        raise CalibrationError("the load cell is overloaded by this weight: take a lighter one, or check its wires")
    return readings


def on_rate(recorder: CellRecorder, operator: Operator, settings: StageSettings) -> None:
    """An amplifier too slow for the stroke is told first. Raises BenchError where that ends it."""
    rate_hz = recorder.port.rate_hz
    if rate_hz is None:
        raise BenchError("too few lines come to tell their rate: check the amplifier")
    duration_s = settings.depth_m / settings.speed_m_s
    samples = rate_hz * duration_s
    if samples >= LEAST_SAMPLES:
        return
    slower_m_s = settings.speed_m_s * samples / LEAST_SAMPLES
    operator.report(
        f"the amplifier sends {rate_hz:.0f} lines/s: an insertion of {duration_s:.2g} s has only {samples:.0f} samples "
        f"and wants {LEAST_SAMPLES}. Set an HX711's RATE pin high (80 samples/s), choose a faster rate of the "
        f"indicator, or move the stage at --speed {slower_m_s:.2g}"
    )
    if operator.ask("Go on all the same?", {GO_ON: "yes", STOP: "stop"}, recorder.drain) == STOP:
        raise BenchError("stopped: the amplifier is too slow for the stroke")


class Results(NamedTuple):
    trials: list[Analysed]
    muds: dict[str, dict[str, OfMud]]  # by mud and coefficient
    remarks: list[str]
    compared: list[Compared]
    flipper: Mapping[str, Any]  # its summary; empty where there is none


def conclude(
    folder: Path, notebook: Notebook, plan: TrialPlan, compare: Mapping[str, Any] | None, show: Show
) -> Results:
    """From what is on the disk."""
    trials = analyse(load_all(folder, notebook), plan.settings, show)
    errors = {key: _relative_error(entry) for key, entry in notebook.entries.items() if "calibration" in entry}
    muds = {}
    for mud in dict.fromkeys(trial.recorded.mud for trial in trials):
        of_it = [trial for trial in trials if trial.recorded.mud == mud]
        error = max(errors[trial.recorded.key] for trial in of_it)
        measured = all(trial.is_measured for trial in of_it if trial.coefficients)
        depth_errors_m = dict.fromkeys(COEFFICIENTS, plan.depth_error_m)
        if measured:  # but for a shear, whose depth is the one that was set
            depth_errors_m |= {"k_p": 0.0, "k_e": 0.0}
        uncertainties = {
            name: bench_uncertainty(name, plan.settings, depth_errors_m[name], error) for name in COEFFICIENTS
        }
        muds[mud] = {name: of_mud(of_it, name, uncertainty) for name, uncertainty in uncertainties.items()}
    return Results(trials, muds, list_remarks(trials, plan.settings), compared_with(compare, muds), compare or {})


def _relative_error(entry: Mapping[str, Any]) -> float:
    return LoadCellCalibration(**entry["calibration"]).relative_error


def list_remarks(trials: Sequence[Analysed], settings: StageSettings) -> list[str]:
    reported = [f"{trial.recorded.key}: {text}" for trial in trials for text in (trial.problem, trial.remark) if text]
    paced = [(trial.recorded.key, trial.pace) for trial in trials if trial.pace is not None]
    by_pace = {key: remark for key, pace in paced if (remark := speed_remark(pace, settings))}
    if len(by_pace) > 3:
        reported.append(f"in {len(by_pace)} trials {next(iter(by_pace.values()))}")
    else:
        reported += [f"{key}: {remark}" for key, remark in by_pace.items()]
    turned = [trial for trial in trials if trial.profile is not None and trial.profile.turned]
    if turned:
        reported.append(f"in {len(turned)} trials the cell measured the other way round; their signs are turned")
    return reported


def report_of(results: Results, notebook: Notebook, plan: TrialPlan, cell: Mapping[str, Any]) -> dict[str, Any]:
    paces = [trial.pace for trial in results.trials if trial.pace is not None]
    return {
        "experiment": "loadcell",
        "settings": asdict(plan.settings) | {"depth_error_m": plan.depth_error_m},
        "cell": dict(cell),
        "stage": {
            "speed_m_s": known(sum(p.speed_m_s for p in paces) / len(paces)) if paces else None,
            "acceleration_m_s2": known(sum(p.acceleration_m_s2 for p in paces) / len(paces)) if paces else None,
        },
        "muds": [
            {"mud": mud, **{name: _described(reported) for name, reported in coefficients.items()}}
            for mud, coefficients in results.muds.items()
        ],
        "trials": [_trial_described(trial, notebook.entries[trial.recorded.key]) for trial in results.trials],
        "left_out": notebook.left_out,
        "remarks": results.remarks,
        "compared": [
            each._asdict() | {"ratio": known(each.ratio), "ratio_std_error": known(each.ratio_std_error)}
            for each in results.compared
        ],
    }


def _described(reported: OfMud) -> dict[str, Any]:
    return {
        "value": known(reported.value),
        "std_error": known(reported.std_error),
        "trials_error": known(reported.trials_error),
        "shared_error": known(reported.shared_error),
        "repeatability": known(reported.repeatability),
        "trials": [known(value) for value in reported.trials],
    }


def _trial_described(trial: Analysed, entry: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "key": trial.recorded.key,
        **entry,
        **{name: {"value": known(c.value), "std_error": known(c.std_error)} for name, c in trial.coefficients.items()},
        "speed_m_s": None if trial.speed_m_s is None else known(trial.speed_m_s),
        "is_measured": trial.is_measured,
        "place_error_m": trial.position_error_m if trial.is_measured else None,
        "alignment": trial.alignment and {name: known(value) for name, value in trial.alignment._asdict().items()},
        "problem": trial.problem,
        "remark": trial.remark,
    }
