"""Results agree with a known truth: the simulated robot's position, strides with known values, known differences."""

from dataclasses import replace
from datetime import UTC, datetime
from math import copysign, hypot, inf, nan, sqrt
from pathlib import Path
from statistics import fmean
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from pandas import DataFrame

from control.faults import Reaction
from control.geometry import FlipperGeometry
from control.modes import Mode
from control.records import Phase
from estimation.ground_law import UNDECIDED, LawEvidence
from estimation.strokes.origin_fit import student_factor
from experiments.pictures.mud_layout import MudLayout, layout_of_lengths
from experiments.run_report.page import comparison_result, report_of
from experiments.run_report.results import (
    SPEED,
    differences,
    ground_finding,
    headline_of,
    is_shown,
    reaction_of,
    speed_of,
    travel_of,
)
from experiments.run_report.run import MudsFrom, Run, _mud_of, _placed, _trials_in, read_runs
from firmware_host.configuration.configuration import Configuration
from firmware_host.trial import BEGUN, OperatorReport
from logs.fault_history import LoggedCause
from logs.files.log_error import LogError, unwatched
from logs.files.log_reader import read_log
from tests.experiments.run_report.synthetic_runs import run_of, stride
from tests.recorded_walks import record_walks

MUDS = (("48.5", 0.61), ("53.1", 0.61))


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory, configuration: Configuration) -> tuple[Run, float]:
    """Record seven strides from the first mud into the second; return the run and the body's true travel."""
    path = tmp_path_factory.mktemp("logs") / "walked.mcap"
    robot = record_walks(path, configuration, 7)
    (run,) = read_runs([path], layout_of_lengths(MUDS), unwatched)
    return run, robot.robot.plant.body_m


def test_distance_time_and_strides_are_those_of_the_simulated_robot(walked: tuple[Run, float]) -> None:
    run, travel_m = walked
    headline = headline_of(run)
    assert headline["distance_m"] == pytest.approx(travel_m, abs=0.003)
    walking_s = np.count_nonzero(read_log(run.paths[0]).ticks["mode"] == Mode.WALKING) / 380.0
    assert headline["duration_s"] == pytest.approx(walking_s, rel=0.01)
    assert headline["speed_m_s"] == pytest.approx(travel_m / walking_s, rel=0.02)
    assert (headline["strides"], headline["walks"], headline["stops"]) == (7, 1, 0)


def test_each_stride_is_in_the_mud_in_which_the_plates_go_down(walked: tuple[Run, float]) -> None:
    """The true borders are the reference; a stride near a border belongs to no mud."""
    run, _ = walked
    reach_m = 0.06  # 12 cm at 30°
    muds = {"w = 48.5 %": (-1.0, 0.61), "w = 53.1 %": (0.61, 1.22)}
    named = run.strides[run.strides["mud"] != ""]
    assert 5 <= len(named) <= 7 and set(named["mud"]) == set(muds)
    starts_s, position_m = run.strides["start_s"], {row["index"]: row["position_m"] for row in run.walks[0].strides}
    assert run.strides["duration_s"][:-1].tolist() == pytest.approx(np.diff(starts_s).tolist())
    for mud, index in zip(named["mud"], named["index"], strict=True):
        begin_m, end_m = muds[mud]
        assert begin_m < position_m[index] + reach_m < end_m
    softest = {result["mud"]: result["both"]["k_p"].value for result in headline_of(run)["muds"]}
    assert softest["w = 53.1 %"] < 0.5 * softest["w = 48.5 %"]


def test_the_speed_of_a_mud_and_its_error_by_hand() -> None:
    """Steps of 10, 12 and 11 cm in 2 s each give 5.5 cm/s; the last stride has no duration."""
    strides = [stride("a", step_m=step_m, duration_s=2.0) for step_m in (0.10, 0.12, 0.11)]
    (result,) = headline_of(run_of([*strides, stride("a", step_m=0.10)]))["muds"]
    assert result["speed_m_s"] == pytest.approx(0.055)
    assert result["distance_m"] == pytest.approx(0.43)
    assert result["speed_std_error_m_s"] == pytest.approx(student_factor(2) * 0.01 / sqrt(3.0) / 2.0)


def test_the_error_of_a_speed_covers_the_truth() -> None:
    """Two standard errors contain the truth in about 95 of 100 cases, even with five strides."""
    random, covered, count = np.random.default_rng(5), 0, 300
    for _ in range(count):
        durations_s = random.uniform(1.5, 2.5, 5)
        steps_m = 0.05 * durations_s + random.normal(0.0, 0.01, 5)
        result = speed_of(DataFrame({"step_m": steps_m, "duration_s": durations_s}))
        covered += abs(result["speed_m_s"] - 0.05) < 2.0 * result["speed_std_error_m_s"]
    assert 0.92 < covered / count < 0.99


def test_the_coefficient_of_a_mud_is_the_mean_of_both_flippers() -> None:
    values = (1.0e6, 1.1e6, 0.9e6, 1.04e6)
    (result,) = headline_of(run_of([stride("a", *values[:2]), stride("a", *values[2:])]))["muds"]
    assert result["both"]["k_p"].value == pytest.approx(fmean(values))
    assert result["flippers"]["right"]["k_p"].value == pytest.approx(fmean([values[1], values[3]]))


def test_bounds_and_invalid_estimates_are_no_values() -> None:
    run = run_of([stride("a", 0.5e6, 0.5e6, at_least=True), stride("b", 0.2e6, 0.2e6, valid=False)])
    assert report_of([run]).tables[0].rows["k_s"].tolist() == ["≥ 0.50", "-"]


def test_the_hardest_reaction_to_a_cause_counts() -> None:
    causes = (("drive_version", ()), ("loop_overrun", ()), ("bus_off", ("drive_silent",)))
    none, warn, hard = (reaction_of(LoggedCause(0.0, 1, name, (), "", "", then)) for name, then in causes)
    assert none is Reaction.NONE and warn is Reaction.WARN and hard > warn


def test_a_log_s_estimates_stand_even_if_this_version_would_estimate_otherwise(
    two_walks: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The report shows the logged values, without R² and residuals, which would belong to another fit."""
    log = read_log(two_walks)
    older = log._replace(strides=[row | {"k_p": 1.01 * row["k_p"]} for row in log.strides])
    monkeypatch.setattr("experiments.run_report.run.scan_log", lambda *_: older)
    (run,) = read_runs([two_walks], layout_of_lengths(MUDS[:1]), unwatched)
    fitted = run.estimates.groupby("coefficient")["samples"].count()
    assert (fitted["k_p"], fitted["k_e"]) == (0, len(log.strides))
    values = [row["k_p"] for row in older.strides]
    assert headline_of(run)["muds"][0]["both"]["k_p"].value == pytest.approx(fmean(values))


# several runs


def run_with(values: list[float], name: str = "run", mud: str = "48.5", speed_m_s: float = 0.05) -> Run:
    """Return a run with a stride for each value; the right flipper reads 1 % more, and the speeds scatter by 4 %."""
    return run_of(
        [
            stride(mud, value, 1.01 * value, speed_m_s * (0.96 if i % 2 else 1.04), 1.0)
            for i, value in enumerate(values)
        ],
        name,
    )


def between(first: Run, other: Run) -> dict[str, dict[str, Any]]:
    runs = [first, other]
    return {each["quantity"]: each for each in differences(runs, list(map(headline_of, runs)))}


def test_a_known_difference_is_found_with_the_errors_of_both() -> None:
    first, other = run_with([1.0e6, 1.02e6, 0.98e6, 1.0e6], "a"), run_with([1.3e6, 1.31e6, 1.28e6, 1.3e6], "b")
    found = between(first, other)["k_p"]
    assert found["difference"] == pytest.approx(0.2975e6 * 1.005) and is_shown(found)
    errors = [headline_of(each)["muds"][0]["both"]["k_p"].trials_error for each in (first, other)]
    assert found["std_error"] == pytest.approx(hypot(*errors))
    speed = between(first, run_with([1e6] * 4, "c", speed_m_s=0.06))[SPEED]
    assert speed["difference"] == pytest.approx(0.01) and is_shown(speed)


def test_runs_of_two_robots_also_have_the_errors_that_each_shares_among_its_strides() -> None:
    first, other = run_with([1.0e6, 1.02e6] * 4), run_with([1.05e6, 1.07e6] * 4)
    same, another = between(first, other)["k_p"], between(first, replace(other, robot="R2"))["k_p"]
    whole = hypot(*(headline_of(each)["muds"][0]["both"]["k_p"].std_error for each in (first, other)))
    assert another["std_error"] == pytest.approx(whole)
    assert is_shown(same) and not is_shown(another)


def test_muds_are_compared_by_name_however_it_is_written_and_bounds_are_not() -> None:
    first = run_with([1.0e6, 1.1e6], mud="w = 48.5 %")
    assert set(between(first, run_with([1.0e6, 1.1e6], mud="48.50"))) == {SPEED, "k_p", "k_s", "k_e"}
    assert between(first, run_with([1.0e6, 1.1e6], mud="pond")) == {}
    noticed = replace(first, muds_from=MudsFrom.ROBOT)  # of which no two are known to be one mud
    assert between(noticed, first) == between(first, noticed) == {}
    assert set(between(first, run_of([stride("48.5", step_m=0.1, duration_s=1.0, at_least=True)]))) == {SPEED}


def test_the_rest_before_and_after_the_gait_of_a_csv_is_no_walking() -> None:
    phase = [Phase.PAUSE, Phase.REST, Phase.REST, Phase.INSERTION, Phase.STANCE, Phase.SWING, Phase.REST, Phase.REST]
    body_m = np.array([0.0, 0.0, 0.0, 0.0, 0.05, 0.06, 0.06, 0.06])
    walk: Any = SimpleNamespace(phase=np.array(phase), time_s=np.arange(8.0), body_x_m=body_m)
    assert [travel_of([walk], in_gait)["duration_s"] for in_gait in (True, False)] == [2.0, 7.0]
    assert travel_of([walk], in_gait=True)["speed_m_s"] == pytest.approx(0.03)


def test_several_muds_need_the_position_of_the_body() -> None:
    walk: Any = SimpleNamespace(body_x_m=np.array([nan]))
    two, one = ([("A", 0.6), ("B", 0.6)], [("A", 0.6)])
    with pytest.raises(LogError, match="has no position of the body.*name one mud"):
        _placed(Path("walk.csv"), layout_of_lengths(two), [walk])
    assert _placed(Path("walk.csv"), layout_of_lengths(one), [walk]) is not None


@pytest.mark.parametrize("sweep_deg", [30.0, -30.0])
def test_the_plates_of_a_walk_backward_go_down_behind_the_body_and_slip_forward(sweep_deg: float) -> None:
    """They go down 6 cm from the body, and slip by 5 of 12 cm, which a border 4 cm from there lets be in either mud."""
    ahead, sweep_rad = copysign(1.0, sweep_deg), np.radians([sweep_deg, sweep_deg, -sweep_deg])
    series = {"left": {"sweep_angle_rad": sweep_rad}}
    walk: Any = SimpleNamespace(geometry=FlipperGeometry(), time_s=np.arange(3.0), series=series)
    times = {"t_start_s": 0.0, "insertion_s": 1.0, "stamp_s": 2.0}
    row = times | {"flipper": 0, "position_m": 0.0, "step_m": 0.07 * ahead}
    muds = [
        _mud_of(walk, MudLayout(("rear", "front"), (border_m * ahead, inf)), (), row)
        for border_m in (0.10, 0.02, -0.03, 0.0)
    ]
    before, beyond = ("rear", "front")[:: int(ahead)]
    assert muds == [before, "", beyond, ""]


@pytest.mark.parametrize(("depths_m", "alike"), [([0.031, 0.034], True), ([0.02, 0.03, 0.042], False), ([nan], False)])
def test_runs_are_of_like_depths_where_both_ends_are_alike(depths_m: list[float], alike: bool) -> None:
    """The means of 2 to 4.2 cm and of 3 cm are no means of one depth, though one range contains the other."""
    other = run_with([1.0e6] * len(depths_m), "b")
    other = replace(other, strides=other.strides.assign(depth_m=depths_m))
    assert between(run_with([1.0e6, 1.1e6], "a"), other)["k_p"]["like_depths"] is alike  # the first is at 3 cm


def test_a_run_that_is_faster_than_one_backward_differs_by_a_positive_percentage() -> None:
    runs = [run_of([stride("A", step_m=step_m, duration_s=1.0)], name=str(step_m)) for step_m in (-0.1, 0.1)]
    table = comparison_result(runs, [headline_of(run) for run in runs]).tables[1].rows
    assert table.loc[table["quantity"].str.startswith("speed"), "of the first"].tolist() == ["+200 %"]


def test_a_comparison_names_runs_by_their_trials_and_by_their_logs_where_these_repeat() -> None:
    named, repeated = {"mud": "A", "trial": "3", "tags": "wet,warm", "operator": "Anna"}, {"mud": "A", "trial": "4"}
    runs = [run_of([stride("A")], name=f"log-{number}") for number in range(4)]
    trials = [named, repeated, repeated, {}]
    headlines = [headline_of(run) | {"trial": trial} for run, trial in zip(runs, trials, strict=True)]
    labels = ["mud A, trial 3, wet, warm", "mud A, trial 4, log-1", "mud A, trial 4, log-2", "log-3"]
    assert list(comparison_result(runs, headlines).tables[0].rows["run"]) == labels


def test_trials_of_one_daemon_are_runs_of_their_own_and_their_segments_are_not() -> None:
    """As the daemon numbers the logs of one run: nothing, trial 3 in two segments, trial 4."""
    begun = [OperatorReport(BEGUN, datetime.now(UTC), "Anna", text).event for text in ('{"trial": "3"}', "{}")]
    logs: dict[Path, Any] = {
        Path(f"{n}.mcap"): SimpleNamespace(metadata={"segment": str(n)}, events=[{"text": text}])
        for n, text in reversed([*enumerate(["", begun[0], "", begun[1]])])
    }
    assert [[path.stem for path in part] for part in _trials_in(logs)] == [["0"], ["1", "2"], ["3"]]


def test_a_ground_that_does_not_keep_the_law_of_mud_is_a_finding() -> None:
    errors = {"mud": 2.0, "sand": 0.1}
    assert ground_finding(None, 9) == ground_finding(LawEvidence("mud", errors), 9) == []
    for name in ("sand", UNDECIDED):
        assert [len(ground_finding(LawEvidence(name, errors), strides)) for strides in (1, 2)] == [0, 1]


@pytest.mark.parametrize(("step_m", "findings"), [(0.03, 1), (0.01, 0)])
def test_strides_in_their_last_hole_do_not_contradict_the_depth_law_of_mud(step_m: float, findings: int) -> None:
    """Deep strides are weak here. After steps of less than the plate's width (25 mm) each is in a hole."""
    depths_m = [0.03, 0.031, 0.05, 0.052, 0.029, 0.03, 0.051, 0.05]
    made = []
    for index, depth_m in enumerate(depths_m):
        is_deep, is_next_deep = depth_m > 0.04, depths_m[(index + 1) % len(depths_m)] > 0.04
        value = 0.4e6 if is_deep else 3e6
        own, estimates = stride("A", value, value, step_m if is_next_deep else 0.06)
        known = {"index": index, "depth_m": depth_m, "repeatability": 0.05e6}
        made.append((own | {"index": index}, [each | known for each in estimates]))
    run = run_of(made)
    empty = dict.fromkeys(("body_x_m", "time_s", "phase"), np.array([]))
    walk: Any = SimpleNamespace(geometry=FlipperGeometry(), **empty)
    (mud,) = headline_of(replace(run, walks=[walk]))["muds"]
    assert len([text for text in mud["findings"] if text.startswith("k_p")]) == findings
