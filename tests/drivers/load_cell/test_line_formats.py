"""Lines as amplifiers print them, and lines that are no readings."""

from math import isfinite, isnan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.load_cell.line_formats import LineFormat, LineReading, find_format


@pytest.mark.parametrize(
    ("name", "line", "value", "unit"),
    [
        ("number", b"123456\r", 123456.0, ""),
        ("number", b"-8321.5", -8321.5, ""),
        ("number", b"HX711 reading: 123456", 123456.0, ""),
        ("number", b"Load = -0.012 N", -0.012, "n"),
        ("number", b"+0012.3 g", 12.3, "g"),
        ("number", b"1.5e-3 mV/V", 0.0015, "mv/v"),
        ("number", b"77 counts", 77.0, "counts"),
        ("indicator", b"ST,GS,+  12.34kg", 12.34, "kg"),
        ("indicator", b"US,NT,-0.012 N", -0.012, "n"),
        ("indicator", b"ST,NT,+ 0.5", 0.5, ""),
        ("column2", b"1234,\t-77.5;9", -77.5, ""),
        ("column1", b"5 6", 5.0, ""),
        (r"#(?P<value>-?\d+)(?P<unit>g)!", b"#-12g!", -12.0, "g"),
    ],
)
def test_a_line_is_read(name: str, line: bytes, value: float, unit: str) -> None:
    assert LineFormat(name).decode(line) == LineReading(value, unit)


@pytest.mark.parametrize("line", [b"", b"hello", b"12.3.4", b"12\xff4", b"--5", b"1,2", b"ST,GS", b"12 34", b"1e999"])
@pytest.mark.parametrize("name", ["number", "indicator"])
def test_a_malformed_line_is_none(name: str, line: bytes) -> None:
    assert LineFormat(name).decode(line) is None


@pytest.mark.parametrize("line", [b"OL,GS,+-------kg", b"OL", b"------", b"Err 6", b"OVERLOAD", b"+ OL kg"])
def test_an_overloaded_indicator_says_so(line: bytes) -> None:
    reading = LineFormat("indicator").decode(line)
    assert reading is not None and isnan(reading.value)


@pytest.mark.parametrize("line", [b"8388607", b"-8388608", b"8388607 counts"])
def test_the_ends_of_a_converter_are_an_overload(line: bytes) -> None:
    reading = LineFormat("number").decode(line)
    assert reading is not None and isnan(reading.value)


@pytest.mark.parametrize("name", ["numbers", "column0", "column10", "", "(?P<value>"])
def test_a_format_that_there_is_not_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="format"):
        LineFormat(name)


@given(st.binary(max_size=60), st.sampled_from(["number", "indicator", "column1", "column2"]))
def test_no_bytes_break_a_format(line: bytes, name: str) -> None:
    reading = LineFormat(name).decode(line)
    assert reading is None or isnan(reading.value) or isfinite(reading.value)


def test_the_format_of_most_lines_is_found_and_columns_are_left_to_the_operator() -> None:
    found = find_format([b"ST,GS,+1.0kg", b"x", b"US,GS,+1.1kg"])
    assert found is not None and found.name == "indicator"
    found = find_format([b"12", b"13", b"\xff"])
    assert found is not None and found.name == "number"
    assert find_format([b"1,2", b"2,3"]) is None
    assert find_format([]) is None
