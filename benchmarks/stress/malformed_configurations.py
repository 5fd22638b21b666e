"""Configuration and world files as users, editors and broken disks may leave them, derived from valid ones.

The records define the fields, their bounds and their defaults, as for the reader itself. The generator knows what is
wrong with each file, and which key a refusal must name. A fraction of the files is valid field by field, so they are
accepted unless their values contradict one another.
"""

from __future__ import annotations

import json
import random
import tomllib
from collections.abc import Callable
from copy import deepcopy
from math import exp, inf, log, nan
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.stress.parameter_locations import Parameter, fields_of
from firmware_host.configuration.configuration import Configuration
from simulation.harness import world
from simulation.harness.local_setup import configuration_text

ROOT = Path(__file__).parents[2]
FURTHER = """
[[watchdog_endpoints]]
firmware = "0.6.11"
hardware = "4.4.58"
enable = 201
timeout = 200
[friction.left_sweep]
coulomb_nm = 0.01
cogging_per_turn = 84
"""
HOSTILE = ("", "\0", "x" * 100_000, "ü" * 200, "../..", "/dev/full", "\x1b[2J", "\n" * 50, "'; --", "root", "nobody")
OTHER_TYPES: tuple[Any, ...] = (True, 1, 1.5, "1.0", [], [1, [2]], {}, {"a": {"b": 1}}, "", 10**30)
UNREADABLE = ("9" * 5000, '"' + "9" * 2_000_000 + '"')  # for which the reader knows no key
HUGE_NUMBERS = ("0x" + "f" * 6000, "9" * 400, "1e999", "-" + "9" * 400, "0o" + "7" * 9000, '"' + "9" * 900_000 + '"')


class CandidateFile(NamedTuple):
    kind: str
    is_world: bool
    data: bytes
    wrong_key: str = ""  # that a refusal must name; empty: none, or unknown
    bound: str = ""  # that it must name too


class MalformedConfigurations:
    """Owns the random numbers; the same seed makes the same files."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)
        example = (ROOT / "systemd" / "mudskipper.toml").read_text(encoding="utf-8")
        local = configuration_text(Path("m"), Path("m/logs"))
        self._texts = {False: [example, example + FURTHER.replace("sweep", "adduction"), local]}
        self._texts[True] = [(ROOT / "simulation" / "harness" / "example_world.toml").read_text(encoding="utf-8")]
        self._makers: dict[str, tuple[int, Callable[[bool], CandidateFile]]] = {
            "near": (30, self._near),
            "within": (14, self._within),
            "out of bounds": (12, self._out_of_bounds),
            "other type": (8, self._other_type),
            "no number": (6, self._no_number),
            "unknown key": (6, self._unknown_key),
            "hostile text": (6, self._hostile_text),
            "missing": (5, self._missing),
            "twice": (4, self._twice),
            "nested": (3, self._nested),
            "huge": (3, self._huge),
            "truncated": (4, self._truncated),
            "garbled": (5, self._garbled),
            "binary": (2, self._binary),
            "shuffled": (2, self._shuffled),
        }

    def next_file(self) -> CandidateFile:
        kinds = list(self._makers)
        (kind,) = self._chance.choices(kinds, [self._makers[name][0] for name in kinds])
        return self._makers[kind][1](self._chance.random() < 0.25)._replace(kind=kind)

    def _text(self, is_world: bool) -> str:
        return self._chance.choice(self._texts[is_world])

    def _start(self, is_world: bool) -> tuple[dict[str, Any], list[Parameter]]:
        document = tomllib.loads(self._text(is_world))
        gait = document.get("gait", {})
        if "protocol" in gait:
            gait["protocol"] = self._chance.choice(("walking", "single_flipper"))
        record: Any = world.WorldText if is_world else Configuration
        return deepcopy(document), list(fields_of(record, document, None, ()))

    # valid field by field

    def _near(self, is_world: bool) -> CandidateFile:
        """Changes a few values to nearby ones."""
        document, parameters = self._start(is_world)
        for parameter in self._chance.sample(parameters, self._chance.randint(1, 8)):
            _set(document, parameter.path, self._near_value(parameter))
        return _file(document, is_world)

    def _within(self, is_world: bool) -> CandidateFile:
        """Changes a few values to any within their bounds."""
        document, parameters = self._start(is_world)
        for parameter in self._chance.sample(parameters, self._chance.randint(1, 3)):
            _set(document, parameter.path, self._value_within(parameter))
        return _file(document, is_world)

    def _near_value(self, parameter: Parameter) -> Any:
        number = parameter.default
        if parameter.bounds is None or isinstance(number, bool) or not isinstance(number, int | float):
            return self._value_within(parameter)
        near = number * self._chance.uniform(0.7, 1.4) + self._chance.choice((0.0, 0.0, 0.001))
        return parameter.kind(min(max(near, parameter.bounds.minimum), parameter.bounds.maximum))

    def _value_within(self, parameter: Parameter) -> Any:
        if parameter.bounds is None:
            return self._chance.random() < 0.5 if parameter.kind is bool else self._word(parameter)
        low, high = parameter.bounds.minimum, min(parameter.bounds.maximum, 1e12)
        number = self._chance.choice((low, high, self._chance.uniform(low, high)))
        if low >= 0.0 and self._chance.random() < 0.5:
            number = exp(self._chance.uniform(log(max(low, 1e-6)), log(high)))
        return parameter.kind(min(max(number, low), high))

    def _word(self, parameter: Parameter) -> str:
        words = {"method": ("default", "paper", "gait"), "bus": ("left", "right")}
        usual = parameter.default if isinstance(parameter.default, str) else "word"
        return self._chance.choice(words.get(str(parameter.path[-1]), (usual,)))

    # wrong by one value

    def _wrong(
        self, is_world: bool, wanted: Callable[[Parameter], bool], make: Callable[[Parameter], tuple[Any, str]]
    ) -> CandidateFile:
        document, parameters = self._start(is_world)
        parameter = self._chance.choice([parameter for parameter in parameters if wanted(parameter)])
        value, bound = make(parameter)
        _set(document, parameter.path, value)
        return _file(document, is_world)._replace(wrong_key=parameter.key, bound=bound)

    def _out_of_bounds(self, is_world: bool) -> CandidateFile:
        def make(parameter: Parameter) -> tuple[Any, str]:
            assert parameter.bounds is not None
            low, high = parameter.bounds
            beyond = self._chance.choice((1e-6 if parameter.kind is float else 1, 1, 1000, 10**12))
            if high == inf or self._chance.random() < 0.5:
                return parameter.kind(low - beyond * max(1.0, abs(low))), f"{low}"
            return parameter.kind(high + beyond * max(1.0, abs(high))), f"{high}"

        return self._wrong(is_world, lambda parameter: parameter.bounds is not None, make)

    def _other_type(self, is_world: bool) -> CandidateFile:
        def make(parameter: Parameter) -> tuple[Any, str]:
            fitting: Any = (int, float) if parameter.kind is float else parameter.kind
            others = [other for other in OTHER_TYPES if not isinstance(other, fitting) or isinstance(other, bool)]
            return self._chance.choice([other for other in others if type(other) is not parameter.kind]), ""

        return self._wrong(is_world, lambda parameter: True, make)

    def _no_number(self, is_world: bool) -> CandidateFile:
        return self._wrong(
            is_world,
            lambda parameter: parameter.kind is float,
            lambda parameter: (self._chance.choice((nan, inf, -inf)), ""),
        )

    def _unknown_key(self, is_world: bool) -> CandidateFile:
        document, parameters = self._start(is_world)
        path = (
            *self._chance.choice(parameters).path[:-1],
            self._chance.choice(("nam", "x" * 500, "", "a b", "ü", "text")),
        )
        _set(document, path, self._chance.choice((1, "", [], {"a": {}})))
        return _file(document, is_world)._replace(wrong_key=Parameter(path, str, None, None).key)

    def _hostile_text(self, is_world: bool) -> CandidateFile:
        """Sets a hostile text. Some of these are valid: a bus may have any name."""
        document, parameters = self._start(is_world)
        parameters = [parameter for parameter in parameters if parameter.kind is str] or parameters
        _set(document, self._chance.choice(parameters).path, self._chance.choice(HOSTILE))
        return _file(document, is_world)

    def _missing(self, is_world: bool) -> CandidateFile:
        document, _ = self._start(is_world)
        table: Any = document
        while isinstance(table, dict) and table:
            name = self._chance.choice(list(table))
            if self._chance.random() < 0.4 or not isinstance(table[name], dict):
                del table[name]
                break
            table = table[name]
        return _file(document, is_world)

    # wrong as a file

    def _lines(self, is_world: bool) -> list[str]:
        return self._text(is_world).splitlines(keepends=True)

    def _twice(self, is_world: bool) -> CandidateFile:
        lines = self._lines(is_world)
        at = self._chance.choice([n for n, line in enumerate(lines) if "=" in line or line.startswith("[")])
        return _of_text(is_world, "".join([*lines[: at + 1], lines[at], *lines[at + 1 :]]))

    def _shuffled(self, is_world: bool) -> CandidateFile:
        lines = self._lines(is_world)
        self._chance.shuffle(lines)
        return _of_text(is_world, "".join(lines))

    def _truncated(self, is_world: bool) -> CandidateFile:
        text = self._text(is_world)
        return _of_text(is_world, text[: self._chance.randrange(len(text))])

    def _nested(self, is_world: bool) -> CandidateFile:
        depth = self._chance.choice((50, 900, 20_000))
        deep = self._chance.choice(
            (
                f"x = {'[' * depth}{']' * depth}",
                f"x = {'{a=' * depth}1{'}' * depth}",
                f"x{'.a' * min(depth, 3000)} = 1",
                f"[x{'.a' * min(depth, 3000)}]",
                f"x = {'[' * depth}",
            )
        )
        name = self._chance.choice(("x", "robot", "gait", "segment", "bus"))
        return _of_text(is_world, deep.replace("x", name, 1) + "\n" + self._chance.choice(("", self._text(is_world))))

    def _huge(self, is_world: bool) -> CandidateFile:
        made = self._wrong(is_world, lambda parameter: parameter.bounds is not None, lambda parameter: ("HUGE", ""))
        number = self._chance.choice(HUGE_NUMBERS + UNREADABLE)
        reported = made.wrong_key if number not in UNREADABLE else ""
        return made._replace(data=made.data.replace(b'"HUGE"', number.encode()), wrong_key=reported)

    def _garbled(self, is_world: bool) -> CandidateFile:
        data = bytearray(self._text(is_world).encode())
        for _ in range(self._chance.randint(1, 8)):
            data[self._chance.randrange(len(data))] ^= 1 << self._chance.randrange(8)
        return CandidateFile("", is_world, bytes(data))

    def _binary(self, is_world: bool) -> CandidateFile:
        return CandidateFile("", is_world, self._chance.randbytes(self._chance.choice((0, 1, 50, 5000, 100_000))))


def _set(document: Any, path: tuple[str | int, ...], value: Any) -> None:
    for part in path[:-1]:
        document = document.setdefault(part, {}) if isinstance(document, dict) else document[part]
    document[path[-1]] = value


def _file(document: dict[str, Any], is_world: bool) -> CandidateFile:
    return _of_text(is_world, "".join(f"{json.dumps(key)} = {toml_of(value)}\n" for key, value in document.items()))


def _of_text(is_world: bool, text: str) -> CandidateFile:
    return CandidateFile("", is_world, text.encode("utf-8", "surrogatepass"))


def toml_of(value: Any) -> str:
    """Writes a value as TOML, with inline tables only."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml_of(str(key))} = {toml_of(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return f"[{', '.join(map(toml_of, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
