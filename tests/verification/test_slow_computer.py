"""A computer that is slower by a factor misses exactly the ticks whose work takes longer than a period there."""

from __future__ import annotations

from pathlib import Path

import pytest

from control.rate import PERIOD_S
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from simulation.harness.lockstep import Lockstep
from simulation.mud.track import paper_track
from verification.report import run_benchmark
from verification.speed import slow_computer, tick_pictures
from verification.speed.slow_computer import largest_factor, summary_of, walk_slowly
from verification.speed.tick_pictures import fractions_of, plot_parts, plot_ticks
from verification.walks.scaled_clock import RecordedWork, ScaledClock, ScaledWalk
from verification.walks.timed_walk import STAGES
from verification.walks.walk_ticks import END_TICKS, WalkTick, least_work

FACTOR = 5.0


class Work:
    """The processor's count, advanced by hand."""

    def __init__(self) -> None:
        self.done_s = 0.0

    def __call__(self) -> float:
        return self.done_s


def test_the_clock_runs_by_the_factor_in_work_and_stands_still_outside() -> None:
    work = Work()
    clock = ScaledClock(FACTOR, work)
    work.done_s = 10.0
    assert clock.now() == 0.0
    clock.start()
    work.done_s = 10.25
    assert clock.now() == FACTOR * 0.25
    assert clock.stop() == 0.25
    work.done_s = 20.0
    clock.sleep(0.5)
    assert clock.now() == FACTOR * 0.25 + 0.5


def stepped(configuration: Configuration, works_periods: list[float]) -> ScaledWalk:
    """A robot at rest after ticks with this work, in periods of the slow computer, and one more."""
    work = RecordedWork()
    walk = ScaledWalk(configuration, paper_track(), ScaledClock(FACTOR, work))
    for periods in (*works_periods, 0.0):
        work.next_s = periods * PERIOD_S / FACTOR
        walk.step()
    return walk


@pytest.mark.parametrize(
    ("works_periods", "number", "missed"),
    [
        ([0.99, 0.99], 3, 0),
        ([1.5], 2, 0),  # late, but no deadline passes without a tick
        ([2.01], 3, 1),
        ([5.5, 0.1], 7, 4),
        ([1.6, 1.6], 4, 1),  # the lateness adds up
    ],
)
def test_the_ticker_skips_the_deadlines_that_pass_in_a_long_tick(
    works_periods: list[float], number: int, missed: int, configuration: Configuration
) -> None:
    walk = stepped(configuration, works_periods)
    assert (walk.tick_number, walk.loop.missed_ticks) == (number, missed)


def test_the_loop_measures_its_ticks_by_the_slow_clock(configuration: Configuration) -> None:
    timing = stepped(configuration, [0.5, 0.75, 0.25]).loop.timing
    assert timing.tick.max_us == pytest.approx(0.75e6 * PERIOD_S)


def test_without_work_the_walk_is_that_of_the_lockstep(configuration: Configuration) -> None:
    scaled, plain = ScaledWalk(configuration, paper_track(), ScaledClock(0.0)), Lockstep(configuration, paper_track())
    for walk in (scaled, plain):
        walk.run_for(0.5)
    assert scaled.tick_number == plain.tick_number
    assert scaled.loop.mode is plain.loop.mode
    for state, plain_state in zip(scaled.loop.states, plain.loop.states, strict=True):
        assert state == pytest.approx(plain_state)


def walk_tick(worked_s: float, number: int = 0, phase: Phase = Phase.SWING) -> WalkTick:
    return WalkTick(1, number, phase, worked_s)


def test_noise_only_adds_to_the_work_so_the_least_of_identical_walks_counts() -> None:
    walks = [[walk_tick(3e-4), walk_tick(1e-4, 1)], [walk_tick(2e-4), walk_tick(9e-4, 1)]]
    assert least_work(walks) == [walk_tick(2e-4), walk_tick(1e-4, 1)]


def test_walks_that_differ_are_refused() -> None:
    with pytest.raises(RuntimeError, match="differ"):
        least_work([[walk_tick(1e-4, 1)], [walk_tick(1e-4, 2)]])


@pytest.mark.parametrize(
    ("phase", "number", "at_end"),
    [
        (Phase.STANCE, 0, True),
        (Phase.SWING, END_TICKS - 1, True),
        (Phase.SWING, END_TICKS, False),
        (Phase.INSERTION, 0, False),
        (Phase.EXTRACTION, 0, False),
    ],
)
def test_a_stride_has_two_ends(phase: Phase, number: int, at_end: bool) -> None:
    assert walk_tick(1e-4, number, phase).at_end is at_end


def test_the_largest_factor_brings_the_longest_tick_to_a_period() -> None:
    ticks = [walk_tick(PERIOD_S / 4.0), walk_tick(PERIOD_S / 8.0, END_TICKS), walk_tick(PERIOD_S / 10.0, END_TICKS + 1)]
    assert largest_factor(ticks, at_end=True) == pytest.approx(4.0)
    assert largest_factor(ticks, at_end=False) == pytest.approx(8.0)
    assert largest_factor(ticks[:1], at_end=False) is None
    summary = summary_of(ticks)
    assert summary["ticks"] == {"end": 1, "elsewhere": 2}
    assert summary["longest_to_median"] == {"end": 2.0, "elsewhere": 1.0}


def test_a_picture_without_matplotlib_is_refused_before_the_walks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tick_pictures, "find_spec", lambda module: None)
    with pytest.raises(SystemExit, match=r"pip install 'mudskipper\[plots\]'"):
        slow_computer.measure(tmp_path, picture="ticks.png")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "value"),
    [("--walks", "0"), ("--seconds", "0"), ("--seconds", "0.001"), ("--factor", "-1"), ("--factor", "nan")],
)
def test_options_that_leave_nothing_to_measure_are_refused_before_the_walks(
    option: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slow_computer, "walk_once", lambda *_: pytest.fail("it walks"))
    with pytest.raises(SystemExit, match=f"^{option} {value}: must be "):
        run_benchmark(slow_computer.measure, [option, value])


def test_the_parts_of_a_tick_contain_every_stage(tmp_path: Path) -> None:
    stages_us = {stage: float(number) for number, stage in enumerate(STAGES, 1)}
    fractions = fractions_of(stages_us)
    assert sum(fractions.values()) == pytest.approx(1.0)
    plot_parts({"mock": stages_us}, tmp_path / "parts.png")
    assert (tmp_path / "parts.png").stat().st_size > 1000


@pytest.mark.parametrize("ticks", [[walk_tick(1e-4), walk_tick(2e-4, END_TICKS)], [walk_tick(1e-4)]])
def test_a_picture_is_drawn_of_the_ticks(ticks: list[WalkTick], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    plot_ticks(ticks, FACTOR, tmp_path / "ticks.svg")
    assert "<svg" in (tmp_path / "ticks.svg").read_text(encoding="utf-8")


@pytest.fixture
def collected_garbage(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slow_computer, "freeze_garbage", lambda: None)  # it switches garbage collection off


@pytest.mark.usefixtures("collected_garbage")
def test_a_walk_with_recorded_work_misses_the_same_ticks_every_time(tmp_path: Path) -> None:
    """One tick of the recorded walk has more than two periods of work; its effect is counted where it is."""
    ticks = slow_computer.measure_work(tmp_path, 1.3, walks=1)
    stance = next(position for position, tick in enumerate(ticks) if tick.phase is Phase.STANCE)
    recorded = [tick._replace(worked_s=0.1 * PERIOD_S / FACTOR) for tick in ticks]
    recorded[stance] = recorded[stance]._replace(worked_s=2.5 * PERIOD_S / FACTOR)
    recorded[stance - 9] = recorded[stance - 9]._replace(worked_s=1.2 * PERIOD_S / FACTOR)
    counted = {"end": 1, "elsewhere": 1, "skipped": 1, "mode": "walking"}
    assert walk_slowly(tmp_path / "slow", recorded, FACTOR) == counted
    assert walk_slowly(tmp_path / "again", recorded, FACTOR) == counted
    assert walk_slowly(tmp_path / "faster", recorded, FACTOR / 2.51)["skipped"] == 0
