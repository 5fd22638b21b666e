"""A ground and a gait as values of a program: the tables of their files, checked as the files are."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_checks import key_problems
from firmware_host.configuration.gait_file import as_json, gait_document, read_gait
from firmware_host.configuration.toml_records import parse_document, read_text
from simulation.harness.world import SegmentText, read_world

TRACK_M = 1000.0  # of one ground alone
OF_SEGMENT = {field.name for field in fields(SegmentText)} - {"start_m", "end_m"}


@dataclass(frozen=True, init=False)
class _Tables:
    text: str  # as JSON

    def __init__(self, tables: Mapping[str, Any]) -> None:
        """Keep the tables; a key with None is left out."""
        plain = json.loads(as_json(dict(tables)), object_hook=_given)
        object.__setattr__(self, "text", as_json(plain))

    @property
    def tables(self) -> dict[str, Any]:
        return dict(json.loads(self.text))


def _given(table: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if value is not None}


class Ground(_Tables):
    """The ground along a track: a world file, keywords with its keys, or both, where the keywords count.

    The keys of one segment make a track of one ground. Raises ConfigurationError.

    >>> firm, sand = Ground(water_percent=45.3), Ground(sand="generic")
    >>> two = Ground(
    ...     segment=[
    ...         {"start_m": 0.0, "end_m": 0.5, "strength_pa": 500.0},
    ...         {"start_m": 0.5, "end_m": 2.0, "strength_pa": 2500.0},
    ...     ]
    ... )
    >>> two.tables["segment"][1]["end_m"]
    2.0
    >>> Ground(strength_pa=5.0)
    Traceback (most recent call last):
    firmware_host.configuration.file_problems.ConfigurationError: segment 1.strength_pa = 5.0: must be at least 50.0
    """

    def __init__(self, file: str | Path | None = None, /, **tables: Any) -> None:
        document = {} if file is None else parse_document(read_text(Path(file)), Path(file))
        given = {key: value for key, value in (document | tables).items() if value is not None}
        if alone := {key: given.pop(key) for key in sorted(OF_SEGMENT & given.keys())}:
            if "segment" in given:
                raise ConfigurationError([f"{min(alone)}: cannot be combined with segment; remove one of them"])
            given["segment"] = [{"start_m": 0.0, "end_m": TRACK_M} | alone]
        super().__init__(given)
        read_world(self.tables)


World = Ground | str | Path | Mapping[str, Any]


def ground_of(world: World) -> Ground:
    """Return the ground of a world file or of its tables. Raises ConfigurationError."""
    if isinstance(world, Ground):
        return world
    return Ground(**world) if isinstance(world, Mapping) else Ground(world)


class Gait(_Tables):
    """A gait: a gait file or the name of one that ships, keywords with its keys, or both, where the keywords count.

    A robot checks it again, with its reach, speeds and currents, before it walks. Raises ConfigurationError.

    >>> shallow = Gait("ellipse", depths_m=[0.02])
    >>> [phase["name"] for phase in shallow.tables["phase"]]
    ['stance', 'swing']
    """

    def __init__(self, file: str | Path | None = None, /, **tables: Any) -> None:
        try:
            document = {} if file is None else gait_document(str(file))
        except FileNotFoundError as problem:
            raise ConfigurationError([f"{problem.filename}: {problem.strerror}"]) from None
        super().__init__(document | tables)
        path = read_gait(self.tables)
        if problems := list(key_problems(path)):
            raise ConfigurationError(problems).of(path.name or "gait")
