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


@pytest.mark.parametrize(
    ("lines", "positions_m", "jumps"),
    [
        (b"50000 5000 50010 3 5 7", [0.5, None, 0.5001, None, 5e-5, 7e-5], 1),
        (b"50000 0 50010 0 50020", [0.5, None, 0.5001, None, 0.5002], 0),
    ],
)
def test_a_jump_is_accepted_once_it_stays_and_counted(
    lines: bytes, positions_m: list[float | None], jumps: int
) -> None:
    counts = EncoderCounts(1e-5)
    reported = [counts.accept(line, 0.01 * i) for i, line in enumerate(lines.split())]
    assert reported == [each and pytest.approx(each) for each in positions_m]
    assert (counts.malformed, counts.jumps) == (2, jumps)
