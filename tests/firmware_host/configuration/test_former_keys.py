"""Keys of version 0.1 are accepted under their former names, with a warning."""

from operator import attrgetter

import pytest

from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import FORMER_KEYS, parse_configuration
from simulation.harness.world import parse_world

VALUES = {
    "adaptation.min_sweep_deg": 35.0,
    "adaptation.max_sweep_deg": 45.0,
    "estimation.paper_compensation": True,
}
USUAL_VALUE = 0.42


def with_key(text: str, section: str, line: str) -> str:
    return text.replace(f"[{section}]\n", f"[{section}]\n{line}\n", 1)


@pytest.mark.parametrize("key", FORMER_KEYS)
def test_a_former_key_sets_the_present_one_with_a_warning(example_text: str, key: str) -> None:
    section, former = key.split(".")
    value = VALUES.get(key, USUAL_VALUE)
    configuration = parse_configuration(with_key(example_text, section, f"{former} = {str(value).lower()}"))
    assert attrgetter(f"{section}.{FORMER_KEYS[key]}")(configuration) == value
    (warning,) = configuration.warnings
    assert key in warning and f"{section}.{FORMER_KEYS[key]}" in warning


def test_both_names_of_a_key_are_refused(example_text: str) -> None:
    text = with_key(with_key(example_text, "log", "min_free_share = 0.1"), "log", "min_free_fraction = 0.1")
    with pytest.raises(ConfigurationError, match="log.min_free_share"):
        parse_configuration(text)


def test_a_former_key_of_a_world_is_accepted_with_a_warning() -> None:
    world = parse_world(
        "[[segment]]\nstart_m = 0.0\nend_m = 9.0\nwater_percent = 50.0\n[drives]\nrepeated_share = 0.1\n"
    )
    assert world.drive_changes == {"repeated_fraction": 0.1} and len(world.warnings) == 1
