"""One scenario of the deterministic simulation: a world, a configuration, and a schedule of events, as plain data.

Everything that happens follows from this record, to the last bit. Its `repr` is valid Python, so a scenario that broke
a promise can be pasted into the regression list as it is printed.
"""

from typing import Any, NamedTuple

from drivers.drive_types import DEFAULT


class Call(NamedTuple):
    """A client of the operator socket calls a method."""

    at_s: float
    client: str
    method: str
    params: dict[str, Any] = {}


class HangUp(NamedTuple):
    """A client closes its connection; its next call opens another one."""

    at_s: float
    client: str


class Failure(NamedTuple):
    """A component fails, as with `mudskipper fail` or as another row of the table of failures says."""

    at_s: float
    component: str
    kind: str
    for_s: float


class Drift(NamedTuple):
    """Parameters of a simulated drive go linearly to other values and stay there, whatever the operators do."""

    at_s: float
    joint: str
    values: dict[str, Any]  # fields of SimulatedDriveParameters
    for_s: float
    over_s: float = 0.0  # until the values are reached


class Restart(NamedTuple):
    """The supply of a drive dips. Its angle may have another zero afterwards, which lasts until every failure ends."""

    at_s: float
    joint: str
    boot_s: float
    shift_rad: float = 0.0


class Suspend(NamedTuple):
    """The daemon gets SIGSTOP, between two ticks or inside of one, and SIGCONT after a while."""

    at_s: float
    for_s: float
    inside: str = ""  # method of the loop before which it stops, or "bus.NAME": before that bus gets the next command


class Send(NamedTuple):
    """A client sends bytes to the operator socket, which may be no request."""

    at_s: float
    client: str
    data: bytes


class Terminate(NamedTuple):
    """The service is stopped with SIGTERM."""

    at_s: float


Event = Call | HangUp | Failure | Drift | Restart | Suspend | Send | Terminate
Harm = Failure | Drift | Restart | Suspend
LASTING = (Failure, Drift, Suspend)
HARMING = (*LASTING, Restart)


class Surroundings(NamedTuple):
    """The ground, the body, the drives and the configuration, which several scenarios share."""

    seed: int = 0  # of the drives' noise and the mud's history
    strength_pa: float = 1000.0
    depth_m: float = 0.03  # of the first stride
    stone_m: float | None = None  # where along the track a buried stone begins
    disturbed: bool = False  # the mud clings, remoulds and relaxes as in the authors' logs
    free_body: bool = False
    drive_type: str = DEFAULT  # or with a model of motor, as "mit:AK80-9"
    drives: tuple[tuple[str, float], ...] = ()  # fields of SimulatedDriveParameters
    configuration: tuple[tuple[str, Any], ...] = ()  # keys that differ from the example: ("limits.torque_nm", 0.5)


class Scenario(NamedTuple):
    seed: int  # of the failures' own draws
    surroundings: Surroundings
    start: str  # the state of a sound robot at which the schedule begins (starts.py)
    events: tuple[Event, ...]  # in the order of their times
    for_s: float  # then every failure ends, and an operator clears the faults


def end_s(event: Event) -> float:
    """Return when the event is over."""
    return event.at_s + event.for_s if isinstance(event, LASTING) else event.at_s


def describe(scenario: Scenario) -> str:
    """Write a scenario as a readable schedule, one line for each event."""
    given = scenario.surroundings._asdict().items()
    surroundings = ", ".join(f"{name} = {value}" for name, value in given if value not in (None, (), False))
    lines = [f"seed {scenario.seed}: from {scenario.start}, for {scenario.for_s:.3f} s", f"  in {surroundings}"]
    return "\n".join([*lines, *(f"  {event.at_s:6.3f} s  {_text_of(event)}" for event in scenario.events)])


def _text_of(event: Event) -> str:
    match event:
        case Call():
            params = ", ".join(f"{name}={value}" for name, value in event.params.items())
            return f"{event.client} calls {event.method}({params})"
        case HangUp():
            return f"{event.client} hangs up"
        case Failure():
            return f"{event.component} {event.kind} for {event.for_s:g} s"
        case Drift():
            values = ", ".join(f"{name} goes to {value}" for name, value in event.values.items())
            return f"{event.joint}: {values} within {event.over_s:g} s, for {event.for_s:g} s"
        case Restart():
            shift = f", its zero shifted by {event.shift_rad:g} rad" if event.shift_rad else ""
            return f"{event.joint} restarts and boots for {event.boot_s:g} s{shift}"
        case Suspend():
            return f"SIGSTOP {f'inside of {event.inside}' if event.inside else 'between ticks'} for {event.for_s:g} s"
        case Send():
            return f"{event.client} sends {len(event.data)} bytes: {event.data[:16].hex(' ')}"
        case Terminate():
            return "SIGTERM"
