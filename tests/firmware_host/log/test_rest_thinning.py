"""At rest only some ticks are written; around torque and around every change of mode all are."""

import pytest

from control.modes import Mode
from firmware_host.log.rest_thinning import RestThinning
from firmware_host.log.rows import TICK
from tests.firmware_host.synthetic_rows import make_event, make_ticks

REST_HZ, FULL_S = 10.0, 1.0  # every 38th tick; the first 380 in full


def numbers(rows: list[tuple[int, bytes]]) -> list[int]:
    return [TICK.decode(payload)["tick"] for _, payload in rows]


@pytest.fixture
def thinning() -> RestThinning:
    return RestThinning(REST_HZ, FULL_S)


def test_a_rest_is_written_ten_times_a_second_after_a_time_in_full(thinning: RestThinning) -> None:
    thinned = thinning.thin(make_ticks(0, 3800, Mode.IDLE))
    assert numbers(thinned.rows) == [*range(381), *range(418, 3800, 38)]
    assert thinned.notice == "at rest: of the ticks, one in 38 is written from here on"


def test_the_time_before_torque_is_written_after_all_and_nothing_twice(thinning: RestThinning) -> None:
    rows = thinning.thin(make_ticks(0, 3800, Mode.IDLE)).rows
    thinned = thinning.thin(make_ticks(3800, 3801, Mode.ARMING))
    written = numbers(rows + thinned.rows)
    assert thinned.notice == "end of the rest: the 380 ticks held back before this one are written after all"
    assert sorted(written) == sorted(set(written))
    assert set(range(3420, 3801)) <= set(written)
    assert written[-1] == 3800


def test_all_of_torque_and_of_the_time_after_it_is_written(thinning: RestThinning) -> None:
    thinning.thin(make_ticks(0, 1000, Mode.IDLE))
    for mode, first in ((Mode.ARMING, 1000), (Mode.WALKING, 1100), (Mode.STOPPING, 2000), (Mode.FAULT, 2500)):
        rows = thinning.thin(make_ticks(first, first + 300, mode)).rows
        assert set(range(first, first + 300)) <= set(numbers(rows))
    rows = thinning.thin(make_ticks(2800, 3600, Mode.FAULT)).rows
    assert numbers(rows) == [*range(2800, 2881), *range(2888, 3600, 38)]


def test_a_change_of_mode_without_torque_ends_a_rest(thinning: RestThinning) -> None:
    thinning.thin(make_ticks(0, 1000, Mode.IDLE))
    rows = thinning.thin(make_ticks(1000, 1100, Mode.FAULT)).rows
    assert set(range(1000, 1100)) <= set(numbers(rows)) and len(rows) > 400


def test_a_rest_that_begins_and_ends_in_one_batch_has_both_notices(thinning: RestThinning) -> None:
    notice = thinning.thin([*make_ticks(0, 1000, Mode.IDLE), *make_ticks(1000, 1001, Mode.ARMING)]).notice
    assert [part.partition(":")[0] for part in notice.split("; ")] == ["at rest", "end of the rest"]


def test_what_is_held_back_comes_out_at_the_end(thinning: RestThinning) -> None:
    written = numbers(thinning.thin(make_ticks(0, 600, Mode.IDLE)).rows) + numbers(thinning.release())
    assert sorted(written) == list(range(600))
    assert thinning.release() == []


def test_events_are_never_thinned(thinning: RestThinning) -> None:
    thinning.thin(make_ticks(0, 1000, Mode.IDLE))
    assert thinning.thin([make_event("request arm")]).rows == [make_event("request arm")]


def test_a_rate_of_zero_writes_everything() -> None:
    rows = make_ticks(0, 2000, Mode.IDLE)
    assert RestThinning(0.0, FULL_S).thin(rows) == (rows, "")
