"""Any configuration or world file is refused by the name of the wrong key, or gives a robot that works.

The records define the fields, their bounds and their defaults, as for the reader itself. A robot may refuse to arm, as
where its supply counts as too low, but no tick raises, and a robot that is not armed sends no frame that moves a drive.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_type_hints

import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from control.bounds import Bounds
from control.controller import WalkOrder
from control.modes import ENERGISED, Mode, Request
from experiments.bench.rig import on_bench
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.loading import parse_configuration
from firmware_host.configuration.toml_records import RecordReader
from simulation.body.plant_parameters import PlantParameters
from simulation.devices.drive import SimulatedDriveParameters
from simulation.harness import world
from simulation.harness.local_setup import configuration_text
from simulation.harness.lockstep import FIXED_OF_DRIVE, Lockstep
from simulation.harness.world import FIXED_OF_ROBOT, WorldText, parse_world
from simulation.mud.clay import MUDS
from simulation.mud.track import Track
from tests.firmware_host.observed_loop import Observer
from verification.example_robot import EXAMPLE, load_example

WORLD = Path(world.__file__).with_name("example_world.toml").read_text(encoding="utf-8")
TEXTS = (EXAMPLE.read_text(encoding="utf-8"), configuration_text(Path("m"), Path("m/logs")), WORLD)
NO_KEYS = {("text",), *(("robot", name) for name in FIXED_OF_ROBOT), *(("drives", name) for name in FIXED_OF_DRIVE)}


class Parameter(NamedTuple):
    """One value that a file may contain."""

    text: str  # of the file
    path: tuple[str | int, ...]
    kind: type
    bounds: Bounds | None
    value: Any


def parameters_of(text: str, value: Any, path: tuple[str | int, ...] = (), hint: Any = None) -> Iterator[Parameter]:
    """Yield all parameters of a record, of those in it, and of those in its tables and arrays."""
    if is_dataclass(value):
        hints = get_type_hints(type(value), include_extras=True)
        for item in fields(value):
            yield from parameters_of(text, getattr(value, item.name), (*path, item.name), hints[item.name])
    elif isinstance(value, dict | list):
        for name, inner in value.items() if isinstance(value, dict) else enumerate(value):
            if is_dataclass(inner):
                yield from parameters_of(text, inner, (*path, name))
    elif bounds := next((extra for extra in get_args(hint) if isinstance(extra, Bounds)), None):
        yield Parameter(text, path, int if get_args(hint)[0] is int else float, bounds, value)
    elif isinstance(value, str | bool) and object not in get_args(hint):
        yield Parameter(text, path, type(value), None, value)


def parameters_in(text: str) -> list[Parameter]:
    """Return the parameters of a valid file, those that it omits included."""
    if text != WORLD:
        found = [*parameters_of(text, parse_configuration(text))]
    else:
        found = [*parameters_of(text, WorldText(**RecordReader(WorldText).read(tomllib.loads(text))))]
        found += parameters_of(text, PlantParameters(), ("robot",))
        found += parameters_of(text, SimulatedDriveParameters(0), ("drives",))
    return [each for each in found if NO_KEYS.isdisjoint((each.path[:1], each.path[:2]))]


PARAMETERS = {text: parameters_in(text) for text in TEXTS}


def with_values(text: str, values: dict[Parameter, Any]) -> str:
    document = tomllib.loads(text)
    for parameter, value in values.items():
        table: Any = document
        for part in parameter.path[:-1]:
            table = table.setdefault(part, {}) if isinstance(table, dict) else table[part]
        table[parameter.path[-1]] = value
    return tomlkit.dumps(document)


def valid_values(parameter: Parameter) -> st.SearchStrategy[Any]:
    if parameter.bounds is None:
        return st.booleans() if parameter.kind is bool else st.just(parameter.value)
    low, high = parameter.bounds.minimum, min(parameter.bounds.maximum, 1e12)
    anything = st.integers(int(low), int(high)) if parameter.kind is int else st.floats(low, high)
    if parameter.value is None:
        return anything
    near = st.floats(0.7, 1.4).map(lambda factor: parameter.kind(min(max(parameter.value * factor, low), high)))
    return near | near | anything


VALID_FILES = st.sampled_from(TEXTS).flatmap(
    lambda text: (
        st.lists(st.sampled_from(PARAMETERS[text]), min_size=1, max_size=8, unique_by=lambda each: each.path)
        .flatmap(lambda chosen: st.fixed_dictionaries({each: valid_values(each) for each in chosen}))
        .map(lambda values: (text, with_values(text, values)))
    )
)
MALFORMED_FILES = st.builds(
    lambda text, at, removed, inserted: (text, text[:at] + inserted + text[at + removed :]),
    st.sampled_from(TEXTS),
    st.integers(0, 4000),
    st.integers(0, 300),
    st.text(max_size=5) | st.sampled_from(["\n[" + "x.a" * 900 + "]\n", "\nx = " + "[" * 3000, "9" * 400, "1e999"]),
)


def robot_of(text: str, changed: str) -> Lockstep:
    """Make the robot of a file. Raises ConfigurationError."""
    if text != WORLD:
        return Lockstep(on_bench(parse_configuration(changed)), Track([(1.0, MUDS["48.5"])]))
    configuration, read = load_example(), parse_world(changed)
    return Lockstep(configuration, read.track, plant=read.plant(configuration), drives=read.drives(configuration))


def idle(robot: Lockstep) -> None:
    """Check what a robot sends that is not armed."""
    if robot.loop.mode in ENERGISED:
        robot.loop.request(Request.DISARM, robot.now_s)
        robot.step()
    observer = Observer(robot)
    for _ in range(60):
        observer.tick()
        assert not observer.energises and robot.loop.mode not in ENERGISED and not any(robot.loop.sent.torques_nm)


def walk(robot: Lockstep) -> None:
    """Arm and walk for a while, where the robot may."""
    loop = robot.loop
    robot.run_until(lambda: loop.mode is Mode.IDLE and not loop.faults.blocking(), 2.0)
    loop.request(Request.ARM, robot.now_s)
    robot.run_until(lambda: loop.mode is Mode.HOLD, 0.5)
    loop.request(Request.WALK, robot.now_s, WalkOrder(loop.configuration.adaptation.initial_depth_m, True))
    robot.run_for(0.5)


@given(VALID_FILES | MALFORMED_FILES, st.integers(0, 9))
def test_any_file_is_refused_with_a_message_or_gives_a_robot_that_works(file: tuple[str, str], number: int) -> None:
    try:
        robot = robot_of(*file)
    except ConfigurationError as problem:
        assert problem.problems and all(0 < len(each) <= 1000 for each in problem.problems)
        return
    idle(robot)
    if number == 7:  # hypothesis draws the ends of a range too often for a walk
        walk(robot)
        idle(robot)
