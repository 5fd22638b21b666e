"""A value is printed with exactly as many digits as its errors justify."""

from math import inf, nan

import pytest

from experiments.reports.value_text import coefficient_text, fraction_text, value_text


@pytest.mark.parametrize(
    ("value", "errors", "text"),
    [
        (0.07193, (0.00036,), "0.07193 ± 0.00036"),
        (0.2138, (0.0996,), "0.21 ± 0.10"),
        (0.36712, (0.000052, 0.0042), "0.367120 ± 0.000052 ± 0.0042"),
        (-123.4, (45.0,), "-123 ± 45"),
    ],
)
def test_an_error_has_two_digits_and_the_value_ends_with_the_finest(
    value: float, errors: tuple[float, ...], text: str
) -> None:
    assert value_text(value, *errors) == text


def test_units_apply_to_value_and_errors() -> None:
    assert value_text(1.2e6, 3.4e4, per=1e6) == "1.200 ± 0.034"


def test_a_lower_bound_without_an_error_has_two_digits() -> None:
    assert coefficient_text(534_612.0, None, at_least=True) == "≥ 0.53"
    assert coefficient_text(534_612.0, 71_000.0, at_least=True) == "≥ 0.535 ± 0.071"
    assert coefficient_text(534_612.0) == "0.5346"


@pytest.mark.parametrize("error", [None, nan, inf])
def test_an_unknown_error_is_left_out(error: float | None) -> None:
    assert value_text(1.5, error) == "1.500"
    assert value_text(1.5, error, 0.02) == "1.500 ± 0.020"


def test_trials_that_are_all_the_same_have_an_error_of_nothing() -> None:
    assert value_text(1.5, 0.0) == "1.500 ± 0.000"
    assert value_text(1.5, 1e-15) == "1.50000 ± 0.00000"


@pytest.mark.parametrize("value", [None, nan])
def test_a_missing_value_is_a_dash(value: float | None) -> None:
    assert value_text(value, 0.1) == fraction_text(value) == "-"


@pytest.mark.parametrize(
    ("fraction", "text"),
    [(0.0321, "3.2 %"), (0.321, "32 %"), (0.0, "0.0 %"), (1e-16, "0.000 %")],
)
def test_a_fraction_is_printed_in_percent_with_two_digits(fraction: float, text: str) -> None:
    assert fraction_text(fraction) == text
