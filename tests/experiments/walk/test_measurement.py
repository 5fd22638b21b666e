"""Walks over several muds: the mud of each stride, with and without a pose, and the paper's findings next to ours."""

import json
from contextlib import closing
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from command_line import exit_codes
from command_line.main import main
from control.records import COEFFICIENTS
from experiments.robot.lockstep_robot import LockstepRobot
from experiments.studies import walk
from experiments.studies.walk import walking_bench
from experiments.study.notebook import NAME, Entry, Notebook
from experiments.trackway.bench import Muds, reach_of
from experiments.trials.estimation_methods import COMPENSATED, DEFAULT, PAPER
from experiments.trials.mud_trials import InvalidTrialError, MeasuredTrials
from experiments.walk.known_surface import KNOWN, KNOWN_COMPENSATED
from experiments.walk.measurement import MUDS, WalkTrials, measure, monitor_advance, require_mud
from experiments.walk.report import Report, compared_strides, result_of, walks_of
from tests.experiments.synthetic_strides import CONFIGURATION, make_estimate, make_stride
from tests.scripted_operator import ScriptedOperator

pytestmark = pytest.mark.usefixtures("png_alone")

SHORT = WalkTrials((("47.6", 0.3), ("51.2", 0.3)), trials=1, soft=("51.2",), soft_strides=2, simulated=True)
ALL_METHODS = [DEFAULT, PAPER, COMPENSATED, KNOWN, KNOWN_COMPENSATED]
TINY = WalkTrials((("47.6", 0.2),), trials=1, simulated=True)


@cache
def measured() -> dict[str, Entry]:
    """Return the entries of `mudskipper experiment walk`, which asks nothing and leaves a folder with all results."""
    command = ["experiment", "walk", "--simulated", "--mud", "47.6=30", "--mud", "51.2=30", "--trials", "1"]
    with TemporaryDirectory() as name, pytest.MonkeyPatch.context() as patch:
        patch.setattr(walk, "WalkTrials", partial(WalkTrials, soft_strides=2))
        assert main([*command, "--soft", "51.2", "--out", name]) == exit_codes.OK
        folder = Path(name)
        assert {"report.html", "summary.json", "figure6_trial1.png"} <= {path.name for path in folder.iterdir()}
        first, *_ = (folder / NAME).read_text(encoding="utf-8").splitlines()
        return Notebook(folder, json.loads(first)["plan"]).entries


def report(plan: WalkTrials = SHORT, truth: dict[str, dict[str, float]] | None = None) -> Report:
    return dict(result_of(plan, MeasuredTrials(CONFIGURATION, measured(), {}), truth).summary)


# the plan


@pytest.mark.parametrize(
    ("plates_m", "slip_m", "mud"),
    [
        *((0.57, 0.0, "47.6"), (0.59, 0.0, ""), (0.63, 0.0, ""), (0.65, 0.0, "49.5"), (9.0, 0.0, "")),
        *((0.66, 0.01, "49.5"), (0.66, 0.03, ""), (0.66, 0.07, "")),
    ],
)
def test_a_plate_belongs_to_the_mud_in_which_it_stays_unless_it_is_near_a_border(
    plates_m: float, slip_m: float, mud: str
) -> None:
    """The border is at 61 cm."""
    assert WalkTrials().layout.mud_at(plates_m, slip_m) == mud


def test_a_walk_without_any_estimate_is_invalid() -> None:
    nothing = make_estimate(None)
    with pytest.raises(InvalidTrialError, match="no stride of the left flipper"):
        require_mud([], "left")
    with pytest.raises(InvalidTrialError, match="no stride met mud"):
        require_mud([make_stride(k_p=nothing, k_s=nothing, k_e=nothing)] * 2, "left")
    require_mud([make_stride(k_p=nothing, k_s=nothing)], "left")


# a short experiment in simulation


def test_every_walk_is_in_the_notebook_with_all_methods() -> None:
    assert list(measured()) == ["walk/1", "soft 51.2 at 3 cm/1", "soft 51.2 at 5 cm/1"]
    for entry in measured().values():
        assert list(entry["strides"]) == ALL_METHODS
        assert len({len(strides) for strides in entry["strides"].values()}) == 1


def test_the_robot_walks_past_the_last_mud_and_a_stride_belongs_to_the_mud_in_which_its_plate_stays() -> None:
    """No stride goes down more than a step past the end. A stance is 12 cm long; in soft mud half of it is slip."""
    walks = walks_of(SHORT, measured())
    strides = compared_strides(SHORT, walks, reach_of(CONFIGURATION), None).dropna(subset="plates_m")
    located = strides[(strides["method"] == DEFAULT) & (strides["coefficient"] == "k_s")]
    positions_m = located["plates_m"].tolist()
    assert positions_m == sorted(positions_m) and 0.0 < positions_m[0] < 0.1
    assert SHORT.layout.ends_m[-1] - 0.13 < positions_m[-1] < SHORT.layout.ends_m[-1]
    assert {"47.6", "51.2"} <= set(located["mud"])
    slips_m = [stride["slip_m"] for stride in measured()["walk/1"]["strides"][DEFAULT]]
    for mud, plates_m, slip_m in zip(located["mud"], positions_m, slips_m, strict=True):
        assert not mud or ((0.055 < slip_m < 0.09) if mud == "51.2" else slip_m < 0.055)
        assert mud in ("", SHORT.layout.mud_at(plates_m - slip_m))


def test_the_coefficients_are_those_of_the_load_cell_or_bounds_below_it() -> None:
    """With dry friction in the joints k_p of the soft mud is 8 % high (median of 32 strides of two walks)."""
    for mud in report()["muds"]:
        assert mud["k_p"].value == pytest.approx(mud["truth"]["k_p"], rel=0.16)
    strong = report()["muds"][0]
    assert strong["k_s"].at_least and strong["k_s"].value < strong["truth"]["k_s"]


def test_without_compensation_firm_mud_seems_softer_and_less_so_with_it() -> None:
    """The paper reports the same."""
    rows = [row for row in report()["errors"] if (row["mud"], row["coefficient"]) == ("47.6", "k_s")]
    biases = {row["method"]: row["bias"] or 0.0 for row in rows}
    assert biases[KNOWN] < biases[KNOWN_COMPENSATED] < 0.0
    assert biases[PAPER] < biases[COMPENSATED] < 0.0


def test_the_soft_mud_has_k_s_at_both_depths_by_every_method_and_the_papers_findings_next_to_ours() -> None:
    (soft,) = report()["soft"]
    assert (soft["mud"], [each["depth_cm"] for each in soft["depths"]]) == ("51.2", [3.0, 5.0])
    for each in soft["depths"]:
        assert list(each["k_s"]) == ALL_METHODS
        assert each["truth"] > 0.0 and 2.5 < each["thrust_n"] < 20.0
    found = {row["what"]: row for row in report()["beside_paper"]}
    half = found["k_s over the load cell's at 3 cm, 51.2 % at 5 cm"]
    assert half["paper"] == "0.5" and 0.3 < half["ours"] < 0.8
    assert found["thrust of both flippers in stance, 51.2 % at 5 cm (N)"]["paper"] == "2.5"


def test_the_truth_of_another_load_cell_replaces_the_beds() -> None:
    reported = report(truth={"47.6": {"k_p": 2e6}})
    assert [mud["truth"] for mud in reported["muds"]] == [{"k_p": 2e6}, None]
    assert "51.2 %" in reported["missing_truth"]
    assert {(row["mud"], row["coefficient"]) for row in reported["errors"]} == {("47.6", "k_p")}


def test_the_report_is_json_with_a_table_and_a_picture_of_everything() -> None:
    result = result_of(SHORT, MeasuredTrials(CONFIGURATION, measured(), {}), None)
    assert result.json()["experiment"] == "walk"
    assert [table.name for table in result.tables] == ["muds", "errors", "findings"]
    assert [(figure.name, len(figure.draw().axes)) for figure in result.figures] == [
        ("figure6_trial1", 6),
        ("figure7_51.2", 2),
    ]


# without a pose


class ChangedRobot(LockstepRobot):
    """A robot whose status has no pose, or that another client stops after its first stride."""

    is_blind = is_stopped = False

    def call(self, method: str, **params: Any) -> Any:
        reported = super().call(method, **params)
        if self.is_blind and method == "status":
            reported |= {"body_x_m": None}
        if self.is_stopped and method == "status" and reported["mode"] == "walking" and reported["strides_closed"]:
            super().call("stop")
        return reported


def walk_once(folder: Path, muds: Muds = MUDS, **changes: Any) -> Entry:
    """Walk over long muds, so that only the change of the robot ends the walk."""
    bench = walking_bench(ScriptedOperator(), TINY, Notebook(folder, TINY.identity))
    bench.robot.__class__ = ChangedRobot
    vars(bench.robot).update(changes)
    bench.prepare(TINY.planned[0])
    with closing(bench.robot):
        return measure(bench, replace(TINY, muds=muds), TINY.planned[0])


def test_without_a_pose_the_robot_makes_only_as_many_strides_as_lead_to_the_end(tmp_path: Path) -> None:
    """The muds are 20 cm long and steps at most 12 cm; strides are assigned to muds by their order."""
    entry = walk_once(tmp_path, TINY.muds, is_blind=True)
    assert [remark for remark in entry["remarks"] if "no pose arrives" in remark]
    assert len(entry["strides"][DEFAULT]) == 2
    entries = {"walk/1": json.loads(json.dumps(entry))}
    reported = result_of(TINY, MeasuredTrials(CONFIGURATION, entries, {}), None).summary
    assert reported["without_pose"] == 1
    assert len(reported["muds"][0]["k_p"].trials) == 2


def test_a_walk_that_another_client_stops_is_invalid(tmp_path: Path) -> None:
    with pytest.raises(InvalidTrialError, match="another client in stride 2") as invalid:
        walk_once(tmp_path, is_stopped=True)
    assert invalid.value.entry is not None and len(invalid.value.entry["strides"][DEFAULT]) == 1


def test_without_a_pose_strides_are_spread_over_the_lengths_of_the_muds() -> None:
    plan = replace(SHORT, muds=(("a", 0.2), ("b", 0.6)))
    entry = {"trial": 1, "start_m": None, "truths": {}, "strides": {DEFAULT: [make_stride(place_m=None)] * 4}}
    walks = walks_of(plan, {"walk/1": entry, "walk/2": entry})  # one is planned
    spread = compared_strides(plan, walks, 0.06, None)
    assert spread["mud"].tolist() == [mud for mud in ("a", "b", "b", "b") for _ in COEFFICIENTS]


def test_strides_in_soft_mud_belong_to_their_trial_within_which_they_scatter() -> None:
    plan = replace(SHORT, soft=("53.1",))
    entry = {"trial": 2, "start_m": None, "truths": {}, "strides": {DEFAULT: [make_stride()] * 2}}
    strides = compared_strides(plan, {plan.soft_walks[0][0]: [entry]}, 0.06, None)
    assert strides["trial"].tolist() == [2] * len(COEFFICIENTS)  # the first stride is left out


# the advance of a walk


def evaluate_walk(*statuses: tuple[float, float | None, str]) -> list[str | None]:
    """Evaluate the statuses of a walk over 50 cm that began at 1 m."""
    evaluate = monitor_advance(1.0, 0.5, 0.0)
    return [evaluate({"now_s": now_s, "body_x_m": body_m, "phase": phase}) for now_s, body_m, phase in statuses]


@pytest.mark.parametrize(
    ("statuses", "end"),
    [
        ([(1.0, 1.4, "insertion"), (2.0, 1.51, "stance"), (3.0, 1.51, "insertion")], ""),  # past the last mud
        ([(1.0, 1.2, "stance"), (60.0, 1.22, "swing"), (61.5, 1.22, "swing")], "the robot got stuck after 20 cm"),
        ([(1.0, 1.2, "stance"), (2.9, None, "stance"), (3.0, 1.3, "swing")], None),  # a short gap is tolerated
    ],
)
def test_a_walk_ends_past_the_last_mud_or_where_the_robot_gets_stuck(
    statuses: list[tuple[float, float | None, str]], end: str | None
) -> None:
    assert evaluate_walk(*statuses) == [None, None, end]


def test_a_long_gap_in_the_pose_makes_the_walk_invalid() -> None:
    with pytest.raises(InvalidTrialError):
        evaluate_walk((1.0, 1.2, "stance"), (3.1, None, "stance"))
