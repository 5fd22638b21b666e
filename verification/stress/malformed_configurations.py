"""Configuration and world files as users, editors and broken disks may leave them, derived from valid ones.

The records define the fields, their bounds and their defaults, as for the reader itself. The generator knows which key
a refusal must name. A fraction of the files is valid field by field, so they are accepted unless their values
contradict one another.
"""

import json
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from math import exp, inf, log, nan
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, get_args, get_type_hints

from control.bounds import Bounds
from control.gait.gait import PROTOCOLS
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import RecordReader
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters as DriveParameters
from simulation.harness import world
from simulation.harness.local_setup import configuration_text
from simulation.harness.world import FIXED_OF_DRIVE, FIXED_OF_ROBOT, WorldText
from verification.example_robot import EXAMPLE

WORLD = Path(world.__file__).with_name("example_world.toml").read_text(encoding="utf-8")
CONFIGURATIONS = (EXAMPLE.read_text(encoding="utf-8"), configuration_text(Path("m"), Path("m/logs")))
HOSTILE = ("", "\0", "x" * 100_000, "ü" * 200, "../..", "/dev/full", "\x1b[2J", "\n" * 50, "'; --", "root", "nobody")
OTHER_TYPES: tuple[Any, ...] = (True, 1, 1.5, "1.0", [], [1, [2]], {}, {"a": {"b": 1}}, "", 10**30)
UNREADABLE = ("9" * 5000, '"' + "9" * 2_000_000 + '"')  # for which the reader knows no key
HUGE_NUMBERS = ("0x" + "f" * 6000, "9" * 400, "1e999", "-" + "9" * 400, "0o" + "7" * 9000, '"' + "9" * 900_000 + '"')
NESTED: tuple[Callable[[int], str], ...] = (
    lambda depth: f"x = {'[' * depth}{']' * depth}",
    lambda depth: f"x = {'{a=' * depth}1{'}' * depth}",
    lambda depth: f"x{'.a' * depth} = 1",
    lambda depth: f"[x{'.a' * depth}]",
    lambda depth: f"x = {'[' * 7 * depth}",
)
NO_KEYS = {("text",), *(("robot", name) for name in FIXED_OF_ROBOT), *(("drives", name) for name in FIXED_OF_DRIVE)}
WORDS = {"method": ("default", "paper", "gait"), "bus": ("left", "right")}
KeyPath = tuple[str | int, ...]


class CandidateFile(NamedTuple):
    kind: str
    is_world: bool
    data: bytes
    wrong_key: str  # that a refusal must name; empty: none, or unknown
    bound: str  # that it must name too


class Parameter(NamedTuple):
    """One value that a file may contain."""

    path: KeyPath
    kind: type
    bounds: Bounds | None
    value: Any


def key_of(path: KeyPath) -> str:
    """Return the name of a value in a refusal."""
    return "".join(f" {part + 1}" if isinstance(part, int) else f".{part}" for part in path)[1:]


def parameters_of(value: Any, path: KeyPath = (), hint: Any = None) -> Iterator[Parameter]:
    """Yield all parameters of a record, of those in it, and of those in its tables and arrays."""
    if is_dataclass(value):
        hints = get_type_hints(type(value), include_extras=True)
        for item in fields(value):
            yield from parameters_of(getattr(value, item.name), (*path, item.name), hints[item.name])
    elif isinstance(value, dict | list):
        for name, inner in value.items() if isinstance(value, dict) else enumerate(value):
            if is_dataclass(inner):
                yield from parameters_of(inner, (*path, name))
    elif bounds := next((extra for extra in get_args(hint) if isinstance(extra, Bounds)), None):
        yield Parameter(path, int if get_args(hint)[0] is int else float, bounds, value)
    elif isinstance(value, str | bool) and object not in get_args(hint):
        yield Parameter(path, type(value), None, value)


def parameters_in(text: str) -> list[Parameter]:
    """Return the parameters of a valid file, those that it omits included."""
    if text == WORLD:
        found = [*parameters_of(WorldText(**RecordReader(WorldText).read(tomllib.loads(text))))]
        found += [*parameters_of(PlantParameters(), ("robot",)), *parameters_of(DriveParameters(0), ("drives",))]
    else:
        found = [*parameters_of(parse_configuration(text))]
    return [each for each in found if NO_KEYS.isdisjoint((each.path[:1], each.path[:2]))]


class Draft:
    """Owns one file in the making. Each public method makes a kind of file and returns its content."""

    parameters = {text: parameters_in(text) for text in (WORLD, *CONFIGURATIONS)}

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self.is_world = chance.random() < 0.25
        self._text = WORLD if self.is_world else chance.choice(CONFIGURATIONS)
        self._document = tomllib.loads(self._text)
        self._parameters = self.parameters[self._text]
        if "protocol" in self._document.get("gait", {}):
            self._document["gait"]["protocol"] = chance.choice(tuple(PROTOCOLS))
        self.wrong_key = self.bound = ""

    def _set(self, path: KeyPath, value: Any) -> str:
        """Change one value and return the whole file."""
        table: Any = self._document
        for part in path[:-1]:
            table = table.setdefault(part, {}) if isinstance(table, dict) else table[part]
        table[path[-1]] = value
        return "".join(f"{json.dumps(key)} = {toml_of(value)}\n" for key, value in self._document.items())

    def _choose(self, wanted: Callable[[Parameter], bool] = lambda parameter: True) -> Parameter:
        """Choose the parameter that the refusal must name."""
        parameter = self._chance.choice([each for each in self._parameters if wanted(each)])
        self.wrong_key = key_of(parameter.path)
        return parameter

    def near(self) -> str:
        """Change a few values to nearby ones, so each is valid by itself."""
        return self._change_some(8, self._near_value)

    def within(self) -> str:
        """Change a few values to any within their bounds, so each is valid by itself."""
        return self._change_some(3, self._value_within)

    def _change_some(self, most: int, value_of: Callable[[Parameter], Any]) -> str:
        text = ""
        for parameter in self._chance.sample(self._parameters, self._chance.randint(1, most)):
            text = self._set(parameter.path, value_of(parameter))
        return text

    def _near_value(self, parameter: Parameter) -> Any:
        if parameter.bounds is None or parameter.value is None:
            return self._value_within(parameter)
        near = parameter.value * self._chance.uniform(0.7, 1.4) + self._chance.choice((0.0, 0.0, 0.001))
        return parameter.kind(min(max(near, parameter.bounds.minimum), parameter.bounds.maximum))

    def _value_within(self, parameter: Parameter) -> Any:
        if parameter.bounds is None:
            usual = (False, True) if parameter.kind is bool else (parameter.value,)
            return self._chance.choice(WORDS.get(str(parameter.path[-1]), usual))
        low, high = parameter.bounds.minimum, min(parameter.bounds.maximum, 1e12)
        number = self._chance.choice((low, high, self._chance.uniform(low, high)))
        if low >= 0.0 and self._chance.random() < 0.5:
            number = exp(self._chance.uniform(log(max(low, 1e-6)), log(high)))
        return parameter.kind(min(max(number, low), high))

    def out_of_bounds(self) -> str:
        parameter = self._choose(lambda parameter: parameter.bounds is not None)
        assert parameter.bounds is not None
        low, high = parameter.bounds
        beyond = self._chance.choice((1e-6 if parameter.kind is float else 1, 1, 1000, 10**12))
        if high == inf or self._chance.random() < 0.5:
            self.bound = f"{low}"
            return self._set(parameter.path, parameter.kind(low - beyond * max(1.0, abs(low))))
        self.bound = f"{high}"
        return self._set(parameter.path, parameter.kind(high + beyond * max(1.0, abs(high))))

    def no_number(self) -> str:
        return self._set(self._choose(lambda each: each.kind is float).path, self._chance.choice((nan, inf, -inf)))

    def other_type(self) -> str:
        parameter = self._choose()
        fitting = (int, float) if parameter.kind is float else (parameter.kind,)
        others = [other for other in OTHER_TYPES if type(other) not in fitting]
        return self._set(parameter.path, self._chance.choice(others))

    def huge(self) -> str:
        text = self._set(self._choose(lambda parameter: parameter.bounds is not None).path, "HUGE")
        number = self._chance.choice(HUGE_NUMBERS + UNREADABLE)
        self.wrong_key = "" if number in UNREADABLE else self.wrong_key
        return text.replace('"HUGE"', number)

    def unknown_key(self) -> str:
        name = self._chance.choice(("nam", "x" * 500, "", "a b", "ü", "text"))
        path = (*self._choose().path[:-1], name)
        self.wrong_key = key_of(path)
        return self._set(path, self._chance.choice((1, "", [], {"a": {}})))

    def hostile_text(self) -> str:
        """Set a hostile text. Some of these are valid: a bus may have any name."""
        texts = [parameter for parameter in self._parameters if parameter.kind is str] or self._parameters
        return self._set(self._chance.choice(texts).path, self._chance.choice(HOSTILE))

    def missing(self) -> str:
        """Remove lines: keys, heads of sections, or parts of both."""
        lines = self._lines()
        first = self._chance.randrange(len(lines))
        return "".join([*lines[:first], *lines[first + self._chance.randint(1, 5) :]])

    def _lines(self) -> list[str]:
        return [line for line in self._text.splitlines(keepends=True) if "=" in line or line.startswith("[")]

    def twice(self) -> str:
        lines = self._lines()
        at = self._chance.randrange(len(lines))
        return "".join([*lines[:at], lines[at], *lines[at:]])

    def shuffled(self) -> str:
        lines = self._lines()
        return "".join(self._chance.sample(lines, len(lines)))

    def truncated(self) -> str:
        return self._text[: self._chance.randrange(len(self._text))]

    def nested(self) -> str:
        deep = self._chance.choice(NESTED)(self._chance.choice((50, 900, 3000)))
        name = self._chance.choice(("x", "robot", "gait", "segment", "bus"))
        return deep.replace("x", name, 1) + "\n" + self._chance.choice(("", self._text))

    def corrupted(self) -> bytes:
        data = bytearray(self._text.encode())
        for _ in range(self._chance.randint(1, 8)):
            data[self._chance.randrange(len(data))] ^= 1 << self._chance.randrange(8)
        return bytes(data)

    def binary(self) -> bytes:
        return self._chance.randbytes(self._chance.choice((0, 1, 50, 5000, 100_000)))


KINDS: tuple[tuple[Callable[[Draft], str | bytes], int], ...] = (  # with their relative frequencies
    *((Draft.near, 30), (Draft.within, 14), (Draft.out_of_bounds, 12), (Draft.other_type, 8), (Draft.no_number, 6)),
    *((Draft.unknown_key, 6), (Draft.hostile_text, 6), (Draft.missing, 5), (Draft.corrupted, 5), (Draft.twice, 4)),
    *((Draft.truncated, 4), (Draft.nested, 3), (Draft.huge, 3), (Draft.binary, 2), (Draft.shuffled, 2)),
)


def next_file(chance: Random) -> CandidateFile:
    makers, weights = zip(*KINDS, strict=True)
    draft, make = Draft(chance), chance.choices(makers, weights)[0]
    content = make(draft)
    data = content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass")
    return CandidateFile(make.__name__, draft.is_world, data, draft.wrong_key, draft.bound)


def toml_of(value: Any) -> str:
    """Write a value as TOML, with inline tables only."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_of(str(key))} = {toml_of(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_of, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
