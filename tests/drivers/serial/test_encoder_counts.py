"""Counts that are positions, and counts that no body on a rail can reach."""

import pytest

from drivers.serial.encoder_counts import EncoderCounts


@pytest.mark.parametrize("line", [b"x:250", b"x = 250", b" x 250 ", b"x+250"])
def test_a_labelled_count_is_a_position(line: bytes) -> None:
    assert EncoderCounts(-1e-3, "x", origin_m=1.0).accept(line, 0.0) == pytest.approx(-1.25)


@pytest.mark.parametrize(
    "line", [b"250", b"x2.5", b"y:250", b"x", b"", b"x 2 5", b"x0x10", b"x" + b"1" * 16, b"x-", b"\xff"]
)
def test_a_line_without_a_count_is_malformed(line: bytes) -> None:
    counts = EncoderCounts(1e-3, "x")
    assert counts.accept(line, 0.0) is None
    assert (counts.accepted, counts.malformed) == (0, 1)


def test_a_label_is_no_pattern_and_may_be_left_out() -> None:
    assert EncoderCounts(1e-3, "p.").accept(b"p. 250", 0.0) == pytest.approx(0.25)
    assert EncoderCounts(1e-3, "p.").accept(b"px 250", 0.0) is None
    assert EncoderCounts(1e-3).accept(b" +250 ", 0.0) == pytest.approx(0.25)


def test_a_jump_is_accepted_once_it_stays_and_is_counted() -> None:
    counts = EncoderCounts(1e-5)
    reported = [counts.accept(line, 0.01 * i) for i, line in enumerate([b"50000", b"5000", b"50010", b"3", b"5", b"7"])]
    assert reported == [pytest.approx(0.5), None, pytest.approx(0.5001), None, pytest.approx(5e-5), pytest.approx(7e-5)]
    assert (counts.malformed, counts.jumps) == (2, 1)


def test_a_spike_is_rejected_again_where_counts_came_in_between() -> None:
    counts = EncoderCounts(1e-5)
    reported = [counts.accept(line, 0.01 * i) for i, line in enumerate([b"50000", b"0", b"50010", b"0", b"50020"])]
    assert reported == [pytest.approx(0.5), None, pytest.approx(0.5001), None, pytest.approx(0.5002)]
    assert (counts.malformed, counts.jumps) == (2, 0)
