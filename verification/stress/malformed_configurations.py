"""Configuration and world files as users, editors and broken disks may leave them, derived from valid ones.

The records define the fields, their bounds and their defaults, as for the reader itself. The generator knows which key
a refusal must name. A fraction of the files is valid field by field, so they are accepted unless their values
contradict one another.
"""

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from math import exp, inf, log, nan
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, get_args, get_type_hints

import tomlkit

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
TABLES: tuple[Any, ...] = ([], [1, [2]], {}, {"a": {"b": 1}})
WRONG: dict[type, tuple[Any, ...]] = {  # values of other types, and of none
    float: (True, "1.0", "", nan, inf, -inf, *TABLES),
    int: (True, "1.0", "", 1.5, *TABLES),
    bool: (1, 1.5, "1.0", "", *TABLES),
    str: (True, 1, 1.5, 10**30, *TABLES),
}
HUGE_NUMBERS = ("0x" + "f" * 6000, "9" * 400, "1e999", "-" + "9" * 400, "0o" + "7" * 9000, '"' + "9" * 900_000 + '"')
UNREADABLE = ("9" * 5000, '"' + "9" * 2_000_000 + '"')  # for which the reader knows no key
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
    """Owns one file in the making. Each method that KINDS lists makes a kind of file and returns its content."""

    parameters = {text: parameters_in(text) for text in (WORLD, *CONFIGURATIONS)}

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self.is_world = chance.random() < 0.25
        self._text = WORLD if self.is_world else chance.choice(CONFIGURATIONS)
        self._document = tomllib.loads(self._text)
        self._parameters = self.parameters[self._text]
        self._bounded = [each for each in self._parameters if each.bounds is not None]
        if "protocol" in self._document.get("gait", {}):
            self._document["gait"]["protocol"] = chance.choice(tuple(PROTOCOLS))
        self.wrong_key = self.bound = ""

    def _set(self, path: KeyPath, value: Any, is_wrong: bool = True) -> str:
        """Change one value, which a refusal must name if it is wrong, and return the whole file."""
        if is_wrong:
            self.wrong_key = "".join(f" {part + 1}" if isinstance(part, int) else f".{part}" for part in path)[1:]
        table: Any = self._document
        for part in path[:-1]:
            table = table.setdefault(part, {}) if isinstance(table, dict) else table[part]
        table[path[-1]] = value
        return tomlkit.dumps(self._document)

    def valid(self) -> str:
        """Change a few values to nearby ones, or to any within their bounds: each is valid by itself."""
        is_near, text = self._chance.random() < 0.7, ""
        for parameter in self._chance.sample(self._parameters, self._chance.randint(1, 8 if is_near else 3)):
            text = self._set(parameter.path, self._valid_value(parameter, is_near), is_wrong=False)
        return text

    def _valid_value(self, parameter: Parameter, is_near: bool) -> Any:
        chance = self._chance
        if parameter.bounds is None:
            usual = (False, True) if parameter.kind is bool else (parameter.value,)
            return chance.choice(WORDS.get(str(parameter.path[-1]), usual))
        low, high = parameter.bounds.minimum, min(parameter.bounds.maximum, 1e12)
        if is_near and parameter.value is not None:
            number = parameter.value * chance.uniform(0.7, 1.4) + chance.choice((0.0, 0.0, 0.001))
        elif low >= 0.0 and chance.random() < 0.5:
            number = exp(chance.uniform(log(max(low, 1e-6)), log(high)))
        else:
            number = chance.choice((low, high, chance.uniform(low, high)))
        return parameter.kind(min(max(number, low), high))

    def out_of_bounds(self) -> str:
        parameter = self._chance.choice(self._bounded)
        assert parameter.bounds is not None
        low, high = parameter.bounds
        beyond = self._chance.choice((1e-6 if parameter.kind is float else 1, 1, 1000, 10**12))
        side, bound = (-1, low) if high == inf or self._chance.random() < 0.5 else (1, high)
        self.bound = f"{bound}"
        return self._set(parameter.path, parameter.kind(bound + side * beyond * max(1.0, abs(bound))))

    def wrong_type(self) -> str:
        parameter = self._chance.choice(self._parameters)
        return self._set(parameter.path, self._chance.choice(WRONG[parameter.kind]))

    def huge(self) -> str:
        number = self._chance.choice(HUGE_NUMBERS + UNREADABLE)
        text = self._set(self._chance.choice(self._bounded).path, "HUGE", is_wrong=number not in UNREADABLE)
        return text.replace('"HUGE"', number)

    def unknown_key(self) -> str:
        name = self._chance.choice(("nam", "x" * 500, "", "a b", "ü", "text"))
        path = (*self._chance.choice(self._parameters).path[:-1], name)
        return self._set(path, self._chance.choice((1, "", [], {"a": {}})))

    def hostile_text(self) -> str:
        """Set a hostile text. Some of these are valid: a bus may have any name."""
        texts = [parameter for parameter in self._parameters if parameter.kind is str] or self._parameters
        return self._set(self._chance.choice(texts).path, self._chance.choice(HOSTILE), is_wrong=False)

    def other_lines(self) -> str:
        """Remove, repeat or shuffle lines: keys, heads of sections, or parts of both."""
        lines = [line for line in self._text.splitlines(keepends=True) if "=" in line or line.startswith("[")]
        first, count = self._chance.randrange(len(lines)), self._chance.randint(1, 5)
        shuffled = self._chance.sample(lines, len(lines))
        removed, repeated = lines[:first] + lines[first + count :], lines[: first + 1] + lines[first:]
        return "".join(self._chance.choice((removed, removed, repeated, repeated, shuffled)))

    def nested(self) -> str:
        deep = self._chance.choice(NESTED)(self._chance.choice((50, 900, 3000)))
        name = self._chance.choice(("x", "robot", "gait", "segment", "bus"))
        return deep.replace("x", name, 1) + "\n" + self._chance.choice(("", self._text))

    def other_bytes(self) -> bytes:
        """Flip bits of the file, cut it off, or replace it by random bytes."""
        data = bytearray(self._text.encode())
        for _ in range(self._chance.randint(1, 8)):
            data[self._chance.randrange(len(data))] ^= 1 << self._chance.randrange(8)
        cut = self._text.encode()[: self._chance.randrange(len(data))]
        return self._chance.choice((bytes(data), cut, self._chance.randbytes(self._chance.choice((0, 1, 50, 100_000)))))


KINDS: dict[Callable[[Draft], str | bytes], int] = {  # with their relative frequencies
    Draft.valid: 44,
    Draft.out_of_bounds: 12,
    Draft.wrong_type: 14,
    Draft.huge: 3,
    Draft.unknown_key: 6,
    Draft.hostile_text: 6,
    Draft.other_lines: 11,
    Draft.nested: 3,
    Draft.other_bytes: 11,
}


def next_file(chance: Random) -> CandidateFile:
    draft, (make,) = Draft(chance), chance.choices(list(KINDS), list(KINDS.values()))
    content = make(draft)
    data = content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass")
    return CandidateFile(make.__name__, draft.is_world, data, draft.wrong_key, draft.bound)
