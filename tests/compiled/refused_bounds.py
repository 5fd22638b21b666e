"""Prints every key of the configuration that has bounds with the answer to a value beyond each of them, as JSON."""

import json
import math

import tomlkit

from command_line.init.key_reference import Key, configuration_keys
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from tests.folders import EXAMPLE_CONFIGURATION

DRIVE = "left_sweep"  # stands for the drives of all joints
TABLE_OF_ARRAY = "["


def refusals(key: Key) -> list[str]:
    """Return the problems that the configuration reports with the key below its minimum, then above its maximum."""
    assert key.bounds is not None
    below, above = math.nextafter(key.bounds.minimum, -math.inf), math.nextafter(key.bounds.maximum, math.inf)
    if key.kind == "int":
        below, above = int(key.bounds.minimum) - 1, int(key.bounds.maximum) + 1
    return [problem_with(key, value) for value in (below, above)]


def problem_with(key: Key, value: float) -> str:
    document = tomlkit.parse(EXAMPLE_CONFIGURATION.read_text(encoding="utf-8"))
    table = document
    for name in key.section.replace("NAME", DRIVE).split("."):
        table = table.setdefault(name, tomlkit.table())
    table[key.name] = value
    try:
        parse_configuration(tomlkit.dumps(document))
    except ConfigurationError as problem:
        return "; ".join(each for each in problem.problems if key.name in each)
    return ""


if __name__ == "__main__":
    bounded = [key for key in configuration_keys() if key.bounds and not key.section.startswith(TABLE_OF_ARRAY)]
    print(json.dumps({f"{key.section}.{key.name}": refusals(key) for key in bounded}))
