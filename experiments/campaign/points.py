"""The points of a campaign: every combination of the values in [grid], or points drawn at random from [random].

A key is a dotted path into the tables of one walk, such as world.segment.strength_pa. A number in it selects a table of
an array, counted from 1; without a number every table of the array gets the value. The draws of a key depend on the
seed and on the key only.
"""

from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, fields
from functools import partial
from itertools import product
from math import exp, log
from random import Random
from typing import Any

from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.toml_records import RecordReader, shown

Tables = dict[str, Any]
Values = dict[str, Any]  # by key


@dataclass(frozen=True)
class Range:
    """Values from `min` to `max`, uniform in the logarithm where `logarithmic`, else whole numbers where both are."""

    min: float
    max: float
    logarithmic: bool = False

    def draw(self, random: Random) -> float:
        if self.logarithmic:
            drawn = exp(random.uniform(log(self.min), log(self.max)))
            return min(max(drawn, self.min), self.max)  # the exponential may be rounded beyond its end
        if isinstance(self.min, int) and isinstance(self.max, int):
            return random.randint(self.min, self.max)
        return random.uniform(self.min, self.max)


_RANGE = RecordReader(Range)
_RANGE_KEYS = {field.name for field in fields(Range)}


def grid_points(grid: Tables) -> Iterator[Values]:
    """Raises ConfigurationError."""
    lists = _flatten(grid, "grid")
    for key, values in lists.items():
        if not isinstance(values, list):
            raise ConfigurationError([f"grid.{key} = {shown(values)}: must be an array of values, in [brackets]"])
        _require_values("grid", key, values)
    for values in product(*lists.values()):
        yield dict(zip(lists, values, strict=True))


def random_points(sample: Tables, points: int, seed: int) -> Iterator[Values]:
    """Raises ConfigurationError."""
    draws = {key: _draw_of(key, given, Random(f"{seed} {key}")) for key, given in _flatten(sample, "random").items()}
    for _ in range(points):
        yield {key: draw() for key, draw in draws.items()}


def range_ends(sample: Tables) -> Iterator[Values]:
    """Yield each end of each range, which has to be a permitted value too. Raises ConfigurationError."""
    for key, given in _flatten(sample, "random").items():
        if isinstance(given, Mapping):
            limits = _range(key, given)
            yield from ({key: limits.min}, {key: limits.max})


def _draw_of(key: str, given: Any, random: Random) -> Callable[[], Any]:
    if isinstance(given, Mapping):
        return partial(_range(key, given).draw, random)
    if not isinstance(given, list):
        raise ConfigurationError([f"random.{key} = {shown(given)}: must be an array, or {{ min = ..., max = ... }}"])
    return partial(random.choice, _require_values("random", key, given))


def _require_values(section: str, key: str, values: list[Any]) -> list[Any]:
    if not values:
        raise ConfigurationError([f"{section}.{key} = []: must have at least one value"])
    return values


def _range(key: str, given: Mapping[str, Any]) -> Range:
    try:
        _RANGE.read(given)
    except ConfigurationError as problem:
        raise ConfigurationError([f"random.{key}.{each}" for each in problem.problems]) from None
    limits = Range(**given)  # whole numbers stay whole
    if limits.min >= limits.max:
        raise ConfigurationError([f"random.{key}.min = {limits.min}: must be less than max = {limits.max}"])
    if limits.logarithmic and limits.min <= 0:
        raise ConfigurationError([f"random.{key}.min = {limits.min}: must be more than 0 where it is logarithmic"])
    return limits


def _flatten(table: Tables, section: str) -> Values:
    """Return the values of nested tables by dotted key. Raises ConfigurationError where there is none."""
    values = dict(leaves(table))
    if not values:
        raise ConfigurationError([f"{section}: must have at least one key, such as world.segment.strength_pa"])
    return values


def leaves(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables with their dotted keys."""
    for name, value in table.items():
        if isinstance(value, dict) and not value.keys() & _RANGE_KEYS:
            yield from leaves(value, f"{path}{name}.")
        else:
            yield f"{path}{name}", value


def with_values(tables: Tables, values: Values) -> Tables:
    """Return the tables of one walk with these values. Raises ConfigurationError for a key that fits no table."""
    changed = deepcopy(tables)
    for key, value in values.items():
        root, *names = key.split(".")
        if root not in tables or not names:
            raise ConfigurationError([f"{key}: must begin with one of {', '.join(f'{name}.' for name in tables)}"])
        _assign(changed[root], names, value, key)
    return changed


def _assign(target: Any, names: list[str], value: Any, key: str) -> None:
    name, *rest = names
    if isinstance(target, list):
        for table in _selected(target, name, key):
            _assign(table, rest if name.isdecimal() else names, value, key)
    elif not isinstance(target, dict):
        raise ConfigurationError([f"{key} = {shown(value)}: there is a value where {name} would be a key of a table"])
    elif rest:
        _assign(target.setdefault(name, {}), rest, value, key)
    else:
        target[name] = value


def _selected(tables: list[Any], name: str, key: str) -> list[Any]:
    if not name.isdecimal():
        return tables
    if not 1 <= int(name) <= len(tables):
        raise ConfigurationError([f"{key}: there are tables 1 to {len(tables)}, not {name}"])
    return [tables[int(name) - 1]]
