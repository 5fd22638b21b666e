"""The silence of a drive and of each of its signals, on both sides of its bound and in ticks from its begin.

Ages are exact where a stamp is zero: the age is then the time of the tick.
"""

from math import inf, nan, nextafter
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.faults import FAULT_KINDS, Reaction
from control.rate import PERIOD_S
from control.records import NEVER_S
from tests.control.monitors.monitored_joint import BOUNDS, NOW_S, faults_of, healthy, make_monitor, names_of

ANGLE, CURRENT, BOTH = ("angle",), ("current",), ("angle", "current")
SEVERITY = [
    "drive_late",
    "current_stale",
    "current_silent",
    "position_stale",
    "drive_quiet",
    "position_silent",
    "drive_silent",
]


def stamped(signals: tuple[str, ...], stamp_s: float) -> dict[str, Any]:
    return {f"{signal}_stamp_s": stamp_s for signal in signals}


@pytest.mark.parametrize(
    ("signals", "bound_s", "before", "after"),
    [
        (ANGLE, BOUNDS.late_s, "", "drive_late"),
        (CURRENT, BOUNDS.late_s, "", "drive_late"),
        (BOTH, BOUNDS.late_s, "", "drive_late"),
        (ANGLE, BOUNDS.quiet_s, "drive_late", "position_stale"),
        (CURRENT, BOUNDS.quiet_s, "drive_late", "current_stale"),
        (BOTH, BOUNDS.quiet_s, "drive_late", "drive_quiet"),
        (ANGLE, BOUNDS.silence_s, "position_stale", "position_silent"),
        (CURRENT, BOUNDS.silence_s, "current_stale", "current_silent"),
        (BOTH, BOUNDS.silence_s, "drive_quiet", "drive_silent"),
        (("heartbeat",), 0.5, "", "heartbeat_silent"),  # five of them
        (("temperature",), 1.0, "", "temperature_silent"),
        (("bus_voltage",), 1.0, "", "voltage_silent"),
    ],
)
def test_a_signal_may_be_exactly_as_old_as_its_bound(
    signals: tuple[str, ...], bound_s: float, before: str, after: str
) -> None:
    for stamp_s, age_s, name in ((0.0, bound_s, before), (0.0, nextafter(bound_s, inf), after), (3.0, 1.5, "")):
        faults = faults_of(make_monitor(), healthy(stamp_s + age_s, **stamped(signals, stamp_s)), stamp_s + age_s)
        ages_s = {fault.name: dict(fault.values)["age_s"] for fault in faults}
        assert list(ages_s.values()) == [age_s] * len(ages_s)
        assert stamp_s or set(ages_s) == {name} - {""}


@pytest.mark.parametrize(
    ("signal", "names"),
    [
        ("angle", {"position_silent"}),
        ("heartbeat", {"heartbeat_silent"}),
        ("temperature", set()),
        ("bus_voltage", set()),
    ],
)
def test_a_slow_signal_that_never_came_is_not_missed(signal: str, names: set[str]) -> None:
    assert names_of(make_monitor(), healthy(temperature_c=nan, **stamped((signal,), NEVER_S))) == names


@pytest.mark.parametrize(
    ("position_s", "current_s", "signal"),
    [(0.007, 0.006, "position"), (0.006, 0.007, "current"), (0.006, 0.006, "current")],
)
def test_the_older_signal_is_named_and_of_two_equal_ones_the_current(
    position_s: float, current_s: float, signal: str
) -> None:
    late = healthy(1.0, angle_stamp_s=1.0 - position_s, current_stamp_s=1.0 - current_s)
    (fault,) = faults_of(make_monitor(), late, 1.0)
    assert dict(fault.values) == {"signal": signal, "age_s": pytest.approx(max(position_s, current_s))}


def test_a_current_that_is_gone_is_reported_next_to_a_milder_fault_only() -> None:
    quiet_s, silent_s = BOUNDS.quiet_s + 1e-6, BOUNDS.silence_s + 1e-6
    for position_s, expected in (
        (0.0, {"current_silent"}),
        (quiet_s, {"drive_quiet", "current_silent"}),
        (silent_s, {"drive_silent"}),
    ):
        measured = healthy(angle_stamp_s=NOW_S - position_s, current_stamp_s=NOW_S - silent_s)
        assert names_of(make_monitor(), measured) == expected


ages = st.floats(0.0, 0.1) | st.just(inf)


@given(ages, ages)
def test_the_more_severe_of_two_silences_is_reported_and_more_silence_is_never_milder(
    position_s: float, current_s: float
) -> None:
    def reaction(position_age_s: float, current_age_s: float) -> Reaction:
        late = healthy(angle_stamp_s=NOW_S - position_age_s, current_stamp_s=NOW_S - current_age_s)
        found = names_of(make_monitor(), late)
        assert len(found - {"current_silent"}) <= 1
        worst = max(found, key=SEVERITY.index, default="")
        return FAULT_KINDS[worst].reaction if worst else Reaction.NONE

    here = reaction(position_s, current_s)
    assert reaction(position_s + 0.003, current_s) >= here
    assert reaction(position_s, current_s + 0.003) >= here


# in ticks


def last_message_s(now_s: float, period_s: float, offset_s: float) -> float:
    """Return the stamp of the last cyclic message."""
    return NOW_S + offset_s + (now_s - NOW_S - offset_s) // period_s * period_s


@pytest.mark.parametrize("offset", [0.0, 0.15, 0.5, 0.95])
@pytest.mark.parametrize(
    ("name", "signals", "message_s", "earliest"),
    [
        ("drive_late", BOTH, 0.002, 2),
        ("drive_quiet", BOTH, 0.002, 3),
        ("drive_silent", BOTH, 0.002, 9),
        ("position_stale", ANGLE, 0.002, 3),
        ("position_silent", ANGLE, 0.002, 9),
        ("current_stale", CURRENT, 0.002, 3),
        ("current_silent", CURRENT, 0.002, 9),
        ("heartbeat_silent", ("heartbeat",), 0.1, 152),
        ("temperature_silent", ("temperature",), 0.1, 342),
    ],
)
def test_silence_is_noticed_within_its_ticks_wherever_between_two_messages_it_began(
    name: str, signals: tuple[str, ...], message_s: float, earliest: int, offset: float
) -> None:
    monitor, ended = make_monitor(), stamped(signals, last_message_s(NOW_S, message_s, offset * message_s))
    for tick in range(-20, 1000):
        now_s = NOW_S + tick * PERIOD_S
        if name in names_of(monitor, healthy(now_s, **(ended if tick > 0 else {})), now_s):
            break
    assert earliest <= tick <= FAULT_KINDS[name].bound_ticks


@pytest.mark.parametrize(("lost", "faults"), [(False, set()), (True, {"drive_late"})])
def test_messages_every_two_milliseconds_are_never_late_and_one_that_is_lost_is_at_most_late(
    lost: bool, faults: set[str]
) -> None:
    for offset in range(20):
        monitor = make_monitor()
        for tick in range(1, 400):
            now_s = NOW_S + tick * PERIOD_S
            stamp_s = last_message_s(now_s, 0.002, 1e-4 * offset)
            if lost and NOW_S + 0.05 <= stamp_s < NOW_S + 0.052:
                stamp_s -= 0.002
            assert names_of(monitor, healthy(now_s, **stamped(BOTH, stamp_s)), now_s) <= faults


def silences(answers_only: bool, missed: int, lost_after: int) -> list[set[str]]:
    """Return the faults of each tick around a gap of the loop; every tick asks, and its answer has the time of the
    question.

    The answer to the last question before the gap is read after it; answers from tick `lost_after` on are lost.
    """
    monitor, asked_s, now_s = make_monitor(answers_only=answers_only), NOW_S, NOW_S
    found = []
    for tick in range(12):
        dt_s = PERIOD_S * (1 + (missed if tick == 3 else 0))
        now_s += dt_s
        found.append(names_of(monitor, healthy(asked_s), now_s, dt_s=dt_s) & set(SEVERITY))
        if tick < lost_after:
            asked_s = now_s
    return found


@pytest.mark.parametrize("missed", [1, 2, 7, 20, 760])
def test_a_drive_that_was_not_asked_is_not_silent(missed: int) -> None:
    assert not any(silences(True, missed, lost_after=99))
    assert any(silences(False, missed, lost_after=99)) is (missed > 1)


@pytest.mark.parametrize("missed", [0, 7, 20])
def test_a_drive_that_does_not_answer_after_a_gap_is_silent_as_soon_as_without_it(missed: int) -> None:
    found = silences(True, missed, lost_after=3)
    assert found == silences(True, 0, lost_after=3)
    assert found[3:7] == [set(), set(), {"drive_late"}, {"drive_quiet"}]
