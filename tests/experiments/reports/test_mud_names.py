"""A water content is recognised in every spelling; a name that an operator gave a mud stays unchanged."""

import pytest

from experiments.reports.mud_names import mud_key, mud_label, mud_name, mud_text


@pytest.mark.parametrize("name", ["w", "bay=3", "watery clay", "1500 Pa"])
def test_a_free_name_of_a_mud_does_not_change(name: str) -> None:
    assert mud_name(name) == mud_label(name) == mud_text(name) == name


@pytest.mark.parametrize("name", ["47.6", "47.6%", "w47.6", "w = 47.6 %"])
def test_a_water_content_gets_one_percent_sign_however_it_is_written(name: str) -> None:
    assert (mud_name(name), mud_label(name), mud_text(name)) == ("47.6", "w = 47.6 %", "47.6 %")
    assert mud_key(f" {name} ") == mud_key("47.60")


def test_names_that_differ_in_more_than_capitals_are_different_muds() -> None:
    assert mud_key("Pond ") == mud_key("pond") != mud_key("pond 2")
    assert mud_key("48.6") != mud_key("48.61")
