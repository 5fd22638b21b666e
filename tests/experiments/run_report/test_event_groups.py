"""Repeated events and faults become one row each, with their count and the range of their numbers."""

from hypothesis import given
from hypothesis import strategies as st

from experiments.run_report.event_groups import EventGroup, group_events
from experiments.run_report.tables import cause_rows
from logs.fault_history import read_causes


def events(*texts: str) -> list[dict[str, object]]:
    return [{"stamp_s": float(second), "text": text} for second, text in enumerate(texts)]


def test_events_that_differ_in_numbers_are_one_group_with_their_ranges() -> None:
    texts = ("depth 0.0275 m: fastest", "mode hold to walking", "depth 0.0500 m: fastest", "depth 0.0310 m: fastest")
    assert group_events(events(*texts)) == [
        EventGroup(0.0, 3.0, 3, "depth 0.0275 to 0.0500 m: fastest"),
        EventGroup(1.0, 1.0, 1, "mode hold to walking"),
    ]


def test_names_with_digits_are_no_numbers() -> None:
    assert len(group_events(events("robot R1 held", "robot R2 held"))) == 2


def test_two_hundred_overruns_are_one_row() -> None:
    texts = [f"fault loop_overrun (warn): The loop missed {1 + i % 3} of its ticks." for i in range(200)]
    rows = [event for text in texts for event in (text, "over: loop_overrun")]
    logged = events(*rows)
    assert group_events(logged) == []  # faults have a table of their own
    (_, row) = cause_rows(read_causes(logged, ""), 0.0)
    assert row[:2] == ["0.00", "200"]


@given(st.lists(st.sampled_from(["a 1", "a 2", "b", "c 1.5 x 2", "c 3 x 4"]), max_size=30))
def test_every_event_is_in_exactly_one_group(texts: list[str]) -> None:
    groups = group_events(events(*texts))
    assert sum(group.times for group in groups) == len(texts)
    assert [group.first_s for group in groups] == sorted(group.first_s for group in groups)
