"""A campaign draws every kind of event, and finds no broken promise in the regression list."""

from random import Random
from typing import get_args

import pytest

from control.records import JOINTS
from drivers.drive_types import DRIVE_TYPES
from drivers.fault_injection.failure_table import SCHEDULED
from tests.dst.campaign import blocks, main, print_broken, span_of
from tests.dst.drawing import DRAWN, FAMILIES, LARGEST_SHIFT_RAD, Style, draw_scenario
from tests.dst.regressions import REGRESSIONS, Regression
from tests.dst.run import Outcome, run_scenario
from tests.dst.scenario import Call, Drift, Event, Failure, Restart, describe

CI_SEEDS = 200
DRAWN_VALUES = {name for draw in DRAWN for name in draw(Random(1))}


@pytest.mark.parametrize("regression", REGRESSIONS, ids=lambda regression: regression.text)
def test_a_promise_that_was_broken_is_kept(regression: Regression) -> None:
    assert run_scenario(regression.scenario).problem == ""


def test_two_hundred_seeds_draw_every_kind_of_failure_and_call() -> None:
    scenarios = [draw_scenario(seed) for seed in range(CI_SEEDS)]
    events = [event for scenario in scenarios for event in scenario.events]
    drawn = {_family(event.component) for event in events if isinstance(event, Failure)}
    assert drawn >= {component for component, _ in SCHEDULED} and drawn >= {_family(each) for each in FAMILIES}
    assert {event.method for event in events if isinstance(event, Call)} >= {"arm", "walk", "move", "stop", "disarm"}
    assert {type(event) for event in events} == set(get_args(Event))
    assert {name for event in events if isinstance(event, Drift) for name in event.values} >= DRAWN_VALUES
    assert any(event.shift_rad for event in events if isinstance(event, Restart)) or not LARGEST_SHIFT_RAD
    assert {scenario.surroundings.drive_type.partition(":")[0] for scenario in scenarios} == set(DRIVE_TYPES)
    assert max(scenario.for_s for scenario in scenarios) > 15.0  # something slow


def _family(component: str) -> str:
    for joint in JOINTS:
        component = component.replace(joint, "JOINT")
    return component.replace("left", "NAME").replace("right", "NAME")


def test_a_broken_seed_prints_its_schedule_and_the_command_that_repeats_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = Outcome(17, "left_sweep has 3 N·m", "LimitedMotors", 0.1)
    monkeypatch.setattr("tests.dst.campaign.shrink", lambda scenario, breaks: scenario)
    print_broken(broken, shrinks=True, style=Style.SLOW)
    shown = capsys.readouterr().out
    assert shown.count(describe(draw_scenario(17, Style.SLOW))) == 2
    assert "make dst SEEDS=17 ARGS='--only --style slow'" in shown


def test_a_campaign_runs_its_seeds(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["5:6", "--workers", "1"]) == 0
    assert "1 seeds in" in capsys.readouterr().out


@pytest.mark.parametrize("given", [("5:6", "--only"), ("many",)])
def test_seeds_that_are_no_number_are_refused(given: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(given)
    assert f"{given[0]}: must be a count or FIRST:LAST, with --only one seed" in capsys.readouterr().err


def test_blocks_share_their_surroundings_and_cover_every_seed() -> None:
    spans = list(blocks(*span_of("5:40")))
    assert [seed for span in spans for seed in range(*span)] == list(range(5, 40))
    for first, last in spans:
        assert len({draw_scenario(seed).surroundings for seed in range(first, last)}) == 1
    assert span_of("200") == (0, 200)
