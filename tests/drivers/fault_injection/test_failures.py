"""Injected failures: refused where they make no sense, ended by themselves, the same for the same seed."""

import pytest

from control.records import JOINTS, NEVER_S
from drivers.fault_injection.failure_table import EFFECTS, FailureKind
from drivers.fault_injection.failures import LONGEST_S, Failures

BUSES = ("left", "right")


@pytest.fixture
def failures() -> Failures:
    return Failures(BUSES)


def test_every_joint_its_parts_and_every_bus_can_fail(failures: Failures) -> None:
    parts = ("", ".position", ".current", ".heartbeat", ".temperature", ".voltage", ".error", ".command")
    joints = {f"{joint}{part}" for joint in JOINTS for part in parts}
    assert set(failures.families) == joints | {"bus.left", "bus.right", "supply", "pose", "log", "loop", "clock"}


def test_the_table_shows_every_component_with_every_kind_that_is_accepted(failures: Failures) -> None:
    shown = {(component, kind) for component, kind, _ in failures.table()}
    accepted = {(c, k) for c in failures.families for k in FailureKind if failures.refusal(c, k) is None}
    assert shown == accepted
    assert len(shown) == sum(len(EFFECTS[family]) for family in failures.families.values())


@pytest.mark.parametrize(
    ("component", "kind", "said"),
    [
        ("left_knee", "off", "--list"),
        ("left_sweep", "sideways", "it can be off, stuck, garbage, slow, intermittent"),
        ("left_sweep.command", "garbage", "it can be off, slow, intermittent"),
        ("loop", "off", "it can be stuck, slow"),
    ],
)
def test_a_failure_that_makes_no_sense_is_refused_with_the_possible_ones(
    failures: Failures, component: str, kind: str, said: str
) -> None:
    refused = failures.begin(component, kind, 1.0)
    assert refused is not None and said in refused
    assert not failures.failing


@pytest.mark.parametrize("for_s", [0.0, -1.0, LONGEST_S + 0.1, float("nan"), float("inf")])
def test_nothing_fails_for_longer_than_a_minute(failures: Failures, for_s: float) -> None:
    assert "0.01 to 60 s" in str(failures.begin("pose", "off", 1.0, for_s))
    assert not failures.failing


def test_every_failure_ends_by_itself_and_is_reported_once(failures: Failures) -> None:
    for component, kind, _ in failures.table():
        assert failures.begin(component, kind, 1.0, 2.0) is None
        assert failures.update(2.99) == []
        assert failures.of(component) is not None
        assert [(each.component, each.kind) for each in failures.update(3.0)] == [(component, kind)]
        assert failures.update(3.1) == []
        assert not failures.failing


def test_a_failure_replaces_only_the_previous_one_of_the_same_component(failures: Failures) -> None:
    failures.begin("pose", "off", 1.0, 2.0)
    failures.begin("log", "off", 1.0, 2.0)
    failures.begin("pose", "stuck", 2.0, 2.0)
    assert [(each.component, each.kind, each.until_s) for each in failures.active] == [
        ("pose", "stuck", 4.0),
        ("log", "off", 3.0),
    ]


def test_one_failure_or_all_can_be_ended_early(failures: Failures) -> None:
    for component in ("pose", "log", "loop"):
        failures.begin(component, "stuck", 1.0)
    ended = failures.end("log")
    assert ended is not None and ended.component == "log"
    assert failures.end("log") is None
    assert [each.component for each in failures.end_all()] == ["pose", "loop"]
    assert not failures.failing


def test_chance_is_the_same_for_a_seed_and_after_a_reset(failures: Failures) -> None:
    failures.update(5.0)
    drawn = [failures.loses() for _ in range(64)]
    failures.begin("pose", "off", 5.0)
    failures.reset()
    assert not failures.failing and failures.now_s == NEVER_S
    assert [failures.loses() for _ in range(64)] == drawn
    assert [Failures(BUSES, seed=2).loses() for _ in range(1)] * 64 != drawn


def test_slow_messages_take_5_to_20_ms(failures: Failures) -> None:
    failures.update(10.0)
    delays_s = [failures.arrival_s() - 10.0 for _ in range(1000)]
    assert 0.005 <= min(delays_s) < 0.006 and 0.019 < max(delays_s) <= 0.02
