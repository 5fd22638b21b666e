"""A campaign draws every kind of event, continues where it ended, and finds no broken promise in the regression
list.
"""

from __future__ import annotations

import json
from collections import Counter
from math import inf
from pathlib import Path

import pytest

from drivers.fault_injection.failure_table import SCHEDULED
from tests.dst.campaign import Campaign, blocks, main, run_campaign, span_of
from tests.dst.drawing import FAMILIES, draw_scenario
from tests.dst.regressions import REGRESSIONS, Regression
from tests.dst.run import run_scenario
from tests.dst.scenario import Call, Failure

CI_SEEDS = 200


@pytest.mark.parametrize("regression", REGRESSIONS, ids=lambda regression: regression.text)
def test_a_promise_that_was_broken_is_kept(regression: Regression) -> None:
    assert run_scenario(regression.scenario).problem == ""


def test_two_hundred_seeds_draw_every_kind_of_failure_and_call() -> None:
    events = [event for seed in range(CI_SEEDS) for event in draw_scenario(seed).events]
    drawn = {
        (event.component.replace("left_sweep", "JOINT"), event.kind) for event in events if isinstance(event, Failure)
    }
    assert {name for name, _ in drawn} >= {name for name, _ in SCHEDULED}
    assert len({name.replace("left", "") for name, _ in drawn}) >= len(FAMILIES)
    assert {event.method for event in events if isinstance(event, Call)} >= {"arm", "walk", "move", "stop", "disarm"}


def test_a_campaign_goes_on_where_it_ended(tmp_path: Path) -> None:
    progress = tmp_path / "progress"
    first = run_campaign(0, 2, 1, inf, progress)
    again = run_campaign(0, 2, 1, inf, progress)
    assert (first.seeds, again.seeds) == (2, 0)
    assert first.covered


def test_a_campaign_whose_time_is_over_begins_no_seed() -> None:
    assert run_campaign(0, 100, 1, -inf, None) == Campaign(0, 100, covered=Counter())


def test_the_result_is_readable_for_programs(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["5:6", "--workers", "1", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["seeds"], report["broken"]) == (1, [])


def test_blocks_share_their_surroundings_and_cover_every_seed() -> None:
    spans = list(blocks(*span_of("5:40")))
    assert [seed for span in spans for seed in range(*span)] == list(range(5, 40))
    for first, last in spans:
        assert len({draw_scenario(seed).surroundings for seed in range(first, last)}) == 1
    assert span_of("200") == (0, 200)
