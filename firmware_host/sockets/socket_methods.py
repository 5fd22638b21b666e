"""The methods of the status socket: the right, the parameters and the answer of each, in one table.

The daemon validates every request by this table, and the reference in the documentation is written from it. Bounds
that come from the configuration are named here and are checked by the method itself.
"""

from collections.abc import Mapping
from enum import IntEnum, StrEnum
from math import isfinite
from typing import Any, NamedTuple, get_type_hints

from control.bounds import Bounds
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import LONGEST_JSON
from control.records import JOINTS
from drivers.fault_injection.failures import LONGEST_S as LONGEST_FAILURE_S
from drivers.fault_injection.failures import SHORTEST_S as SHORTEST_FAILURE_S
from drivers.fault_injection.failures import USUAL_S
from firmware_host.sockets.rpc import LONGEST_ARRAY, RefusedError
from firmware_host.trial import KEYS as TRIAL_KEYS
from firmware_host.trial import LONGEST_VALUE

LONGEST_LEASE_S, SHORTEST_LEASE_S = 10.0, 0.1
MAX_STRIDES = 100000  # of one walk
STRIDES_PER_ANSWER = PIECES_PER_ANSWER = 20  # an answer is made between two ticks
FAULTS_PER_ANSWER = 48  # two lost buses have about as many
LARGEST_INTEGER = 2**63 - 1
LONGEST_NAME = 64


class Level(IntEnum):
    """What a user may ask for; each level includes those below it."""

    ANYONE = 0
    READ = 1
    DRIVE = 2


class Type(StrEnum):
    NUMBER = "number"
    NUMBERS = "array of numbers"
    INTEGER = "whole number"
    FLAG = "true or false"
    TEXT = "text"


REQUIREMENTS = {
    Type.NUMBER: "a number",
    Type.NUMBERS: "an array of 1 to {longest} numbers",
    Type.INTEGER: "a whole number",
    Type.FLAG: "true or false",
    Type.TEXT: "at most {longest} printable characters",
}


class Parameter(NamedTuple):
    name: str
    type: Type
    meaning: str
    unit: str = ""
    range: Bounds | None = None
    bounds_note: str = ""  # bounds that the configuration sets
    default: bool | int | float | str | None = None
    required: bool = False
    null_is_default: bool = False  # else an explicit null is refused
    longest: int = LONGEST_NAME  # characters of a text, numbers of an array

    @property
    def bounds(self) -> str:
        """Return the permitted values, for messages and documentation."""
        if self.range is None:
            return self.bounds_note
        return f"from {self.range.minimum:.15g} to {self.range.maximum:.15g} {self.unit}".rstrip()

    def value_in(self, params: Mapping[str, Any]) -> Any:
        """Return the value in the parameters of a request, or the default; raises RefusedError."""
        value = params.get(self.name)
        absent = self.name not in params and not self.required
        if absent or (value is None and self.null_is_default):
            return self.default
        if not self._accepts(value):
            bounds = f" {self.bounds}" if self.range else ""
            raise RefusedError(f"{self.name} = {value!r:.60}: must be {self._requirement}{bounds}")
        return value

    @property
    def _requirement(self) -> str:
        return REQUIREMENTS[self.type].format(longest=self.longest)

    def _accepts(self, value: Any) -> bool:
        match self.type:
            case Type.FLAG:
                return isinstance(value, bool)
            case Type.NUMBERS:
                return isinstance(value, list) and 0 < len(value) <= self.longest and all(map(_is_number, value))
            case Type.TEXT:
                return isinstance(value, str) and len(value) <= self.longest and value.isprintable()
            case Type.INTEGER:
                fits = isinstance(value, int) and not isinstance(value, bool)
            case Type.NUMBER:
                fits = _is_number(value)
        return fits and (self.range is None or self.range.minimum <= value <= self.range.maximum)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


class SocketMethod(NamedTuple):
    level: Level
    meaning: str
    parameters: tuple[Parameter, ...] = ()
    answer: str = 'the text "accepted"'
    answer_keys: Mapping[str, str] = {}  # of an answer that is a map, or a list of maps
    refuses_unknown: bool = False  # else a parameter that the method does not have is ignored
    free: Parameter | None = None  # what parameters with any other name are

    def read(self, params: Mapping[str, Any]) -> dict[str, Any]:
        """Return every parameter with its value or default; raises RefusedError for one that is not accepted."""
        names = [parameter.name for parameter in self.parameters]
        unknown = params.keys() - names
        if self.refuses_unknown and unknown:
            raise RefusedError(f"there is no parameter {min(unknown)!r} here; there are: {', '.join(names)}")
        free = [self.free._replace(name=name) for name in sorted(unknown)] if self.free else []
        return {parameter.name: parameter.value_in(params) for parameter in (*self.parameters, *free)}


LEASE_RANGE = Bounds(SHORTEST_LEASE_S, LONGEST_LEASE_S)
TAKE_OVER = "end the lease of another program, whose connection then stays refused"
LEASE = (
    Parameter("take_over", Type.FLAG, TAKE_OVER, default=False),
    Parameter("lease_s", Type.NUMBER, "also take the lease, or renew it, for this time", "s", LEASE_RANGE),
)
IN_RANGE = "inside of the joint's configured range"
ANGLES = tuple(
    Parameter(f"{joint}_rad", Type.NUMBER, f"angle that the {joint} joint moves to", "rad", bounds_note=IN_RANGE)
    for joint in JOINTS
)
SPEED = Parameter(
    "speed_rad_s",
    Type.NUMBER,
    "of the joint with the longest path, its mean over that path; never above motion.path_speed_rad_s",
    "rad/s",
    range=Bounds(0.01, 10.0),
    default=10.0,
)
SINCE = Parameter(
    "since", Type.INTEGER, "number of the first stride wanted", range=Bounds(0, LARGEST_INTEGER), default=0
)
AFTER = Parameter(
    "after_m",
    Type.NUMBER,
    "only pieces beyond this position: the last `place_m` of the answer before; without it, from the beginning",
    "m",
    null_is_default=True,
)
STRIDES = Parameter(
    "strides", Type.INTEGER, "number of strides; 0 walks until a stop", range=Bounds(0, MAX_STRIDES), default=0
)
DEPTH = Parameter(
    "depth_m",
    Type.NUMBER,
    "fixed depth of every stride; without it, or with null, the depth adapts from adaptation.initial_depth_m on",
    "m",
    bounds_note="at least 0.005, at most adaptation.max_depth_m",
    null_is_default=True,
)
DEPTHS = DEPTH._replace(
    name="depths_m",
    type=Type.NUMBERS,
    meaning="fixed depths of the strides in turn, in place of depth_m",
    longest=LONGEST_ARRAY,
)
GAIT_FILE = Parameter(
    "gait",
    Type.TEXT,
    "the tables of a gait file as JSON, in place of the configured gait; its depths_m count where no depth is given",
    longest=LONGEST_JSON,
)
FIXED_DEPTH = DEPTH._replace(meaning="depth of every stride", null_is_default=False, required=True)
GAIT_UNITS = {
    "sweep_angle_deg": "degrees",
    "insertion_speed_m_s": "m/s",
    "stance_speed_m_s": "m/s",
    "extraction_speed_m_s": "m/s",
}
GAIT_HINTS = get_type_hints(GaitParameters, include_extras=True)
GAIT = tuple(
    Parameter(key, Type.NUMBER, f"as gait.{key}; without it, as before", unit, GAIT_HINTS[key].__metadata__[0])
    for key, unit in GAIT_UNITS.items()
)
FAILURE = (
    Parameter("component", Type.TEXT, 'what fails; "all" with kind "ok"', required=True),
    Parameter("kind", Type.TEXT, 'how it fails; "ok" ends the failure', required=True),
    Parameter(
        "for_s",
        Type.NUMBER,
        "how long it fails",
        "s",
        bounds_note=f"from {SHORTEST_FAILURE_S:g} to {LONGEST_FAILURE_S:g} s",
        default=USUAL_S,
    ),
)
TRIAL = tuple(Parameter(key, Type.TEXT, meaning, longest=LONGEST_VALUE) for key, meaning in TRIAL_KEYS.items())
NOTE = Parameter("text", Type.TEXT, "what to write", longest=LONGEST_VALUE, required=True)
CLOCKS = {
    "stamp_s": "the loop's monotonic clock in s, as in the log",
    "time": "the wall clock at the same moment, in ISO 8601",
}
TRIALS = {
    "defaults": "the description that the next walk has",
    "present": "the description of the present walk, or of the one before",
}
STATUS_KEYS = {
    "schema": "version of this answer",
    "robot": "name of the robot",
    "version": "version of the software",
    "compiled": "whether the modules of a tick run compiled",
    "now_s": "the loop's monotonic clock in s, as in the log",
    "mode": "mode of the robot",
    "moving": "whether joints are on their way to a pose that was requested",
    "fault": "the worst present fault that is more than a warning, else one that blocks arming, else nothing",
    "faults": "every present fault: name, subject, message, what_to_do, age_s, reaction, blocks_arming",
    "faults_left_out": f"number of present faults beyond the {FAULTS_PER_ANSWER} with the hardest reactions",
    "causes": "the faults grouped by cause: name, subjects, message, what_to_do, age_s, reaction, consequences",
    "forced": "whether the robot was armed by force against a present fault",
    "power_cut": "why the motors' power counts as cut, or null",
    "notice": "why the robot stopped, until it is moved again",
    "notice_age_s": "time in s since it stopped, or nothing",
    "unlogged_requests": "number of requests since the start that changed nothing or were repeated",
    "lease": "the holder of the lease, or nothing",
    "lease_left_s": "time in s until the lease is lost unless it is renewed",
    "phase": "phase of the stride",
    "stride": "number of the stride in this walk",
    "depth_m": "commanded depth of this stride in m",
    "next_depth_m": "depth of the next stride in m",
    "depth_reason": "why that depth was chosen",
    "full_step_m": "step in m of a stride of the crutching gait in which nothing slips, else 0",
    "body_x_m": "position of the body along the track in m",
    "pose": "source of the body's position and its state",
    "drives": "every drive, in the order of the joints: signals, their ages in s, error text, firmware and watchdog",
    "strides_closed": "number of strides of single flippers since the start",
    "stride_supply_min_v": "lowest voltage of any drive in the last stride in V, or null",
    "mud": "the current estimate of the mud's coefficients in N/m³, of both flippers and of each",
    "loads": "the mud's load on each flipper: torques in N·m, forces in N, depth in m",
    "loop": "rate in Hz, ticks, missed ticks, and percentiles of wake-up delay and tick duration in µs;"
    " a tick lasts until its clients are served",
    "trial": "the description of the present walk, or of the one before",
    "warnings": "weakened protection, and what the computer could not provide for real-time operation",
    "bus": "state of every bus, and counts of errors and lost frames",
    "log": "path of the log, rows dropped, and the state of its writer and disk",
}
STRIDE_KEYS = {
    "number": "number of the stride since the start, over both flippers",
    "flipper": "left or right",
    "k_p, k_s, k_e": "penetration, shear and extraction resistance: value, std_error in N/m³, samples, valid, reason",
    "place_m": "position of the body along the track in m at the end of the insertion",
    "chosen_depth_m": "depth in m that was chosen from it for the next stride",
}
FAILURE_KEYS = {
    "component": "what fails",
    "kind": "how it fails",
    "remaining_s": "time in s until it ends by itself",
    "does": "the effect",
}

METHODS: dict[str, SocketMethod] = {
    "hello": SocketMethod(
        Level.ANYONE,
        "Identify the robot.",
        answer="a map",
        answer_keys={"name": "name of the robot", "version": "version of the software"},
    ),
    "status": SocketMethod(Level.READ, "Report the state of the robot.", answer="a map", answer_keys=STATUS_KEYS),
    "strides": SocketMethod(
        Level.READ,
        f"Report the strides that were learned from, oldest first, at most {STRIDES_PER_ANSWER} in one answer.",
        (SINCE,),
        answer="a list of maps, with every field of a stride in the log; the most important are",
        answer_keys=STRIDE_KEYS,
    ),
    "map": SocketMethod(
        Level.READ,
        "Report the mud along the track since the walk began, in the order of positions,"
        f" at most {PIECES_PER_ANSWER} pieces in one answer.",
        (AFTER,),
        answer="a list of maps",
        answer_keys={
            "place_m": "position along the track in m",
            "k_p, k_s, k_e": "the coefficient there: value and std_error in N/m³",
        },
    ),
    "check": SocketMethod(
        Level.READ,
        "Report what blocks arming, item by item.",
        answer="a list of maps",
        answer_keys={
            "id": "name of the item",
            "ok": "whether it permits arming",
            "warning": "whether it permits arming and is still a reason to worry",
            "text": "its state",
            "fix": "what to do if it is not ok or warns",
            "mandatory": "whether it also blocks arming by force",
            "cause": "the item that this one follows from, if there is one",
        },
    ),
    "arm": SocketMethod(
        Level.DRIVE,
        "Switch torque on and hold the present pose.",
        (
            Parameter("force", Type.TEXT, "the kinds of fault to overrule, such as uncalibrated (or A,B)", default=""),
            *LEASE,
        ),
    ),
    "walk": SocketMethod(
        Level.DRIVE,
        "Walk, with a depth that adapts to the mud or is fixed. A described walk is a trial: it begins a new log.",
        (DEPTH, DEPTHS, STRIDES, GAIT_FILE, *LEASE, *TRIAL),
        refuses_unknown=True,
    ),
    "depth": SocketMethod(
        Level.DRIVE,
        "Fix the depth of the present walk, from the next stride on.",
        (FIXED_DEPTH, *LEASE),
    ),
    "stride": SocketMethod(
        Level.DRIVE,
        "Fix depth and gait of the present walk, from the next stride on, or from the second one late in a swing.",
        (FIXED_DEPTH, *GAIT, *LEASE),
        refuses_unknown=True,
    ),
    "move": SocketMethod(
        Level.DRIVE,
        "Move joints slowly to angles while the robot holds its pose; at least one joint is required.",
        (*ANGLES, SPEED, *LEASE),
        refuses_unknown=True,
    ),
    "stop": SocketMethod(Level.ANYONE, "End a walk with raised flippers, or a move; in hold also another's lease."),
    "disarm": SocketMethod(Level.ANYONE, "Switch torque off at once."),
    "clear": SocketMethod(
        Level.DRIVE,
        "Clear faults whose cause is gone.",
        (Parameter("zero", Type.FLAG, "also accept the angles of joints whose zero may have shifted", default=False),),
    ),
    "lease": SocketMethod(
        Level.DRIVE,
        "Take or renew the lease: if it is not renewed in time, the robot stops. Only its holder moves the robot.",
        (Parameter("for_s", Type.NUMBER, "time within which it is renewed", "s", LEASE_RANGE, required=True),),
    ),
    "release": SocketMethod(Level.DRIVE, "End one's own lease; a lost one ends by itself once torque is off."),
    "trial": SocketMethod(Level.READ, "Report how walks are described.", answer="a map", answer_keys=TRIALS),
    "trial_set": SocketMethod(
        Level.DRIVE,
        "Change the description that walks have by default, until it is changed again. An empty text removes a key."
        " Any other name of lower-case letters, digits and _ is a key too, with a text.",
        TRIAL,
        answer="a map",
        answer_keys=TRIALS,
        free=Parameter("", Type.TEXT, "", longest=LONGEST_VALUE),
    ),
    "note": SocketMethod(
        Level.DRIVE, "Write a note into the log, with both clocks.", (NOTE,), answer="a map", answer_keys=CLOCKS
    ),
    "mark": SocketMethod(
        Level.DRIVE,
        "Write a marker into the log: the moment of a clap, or of a light that a camera sees.",
        (NOTE._replace(required=False, default=""),),
        answer="a map",
        answer_keys=CLOCKS,
    ),
    "reset_timing": SocketMethod(Level.DRIVE, "Start the statistics of the loop's timing again."),
    "fail": SocketMethod(
        Level.DRIVE,
        "Make a component fail on purpose, if failures.allowed permits it.",
        FAILURE,
        answer="a list of maps: what fails now",
        answer_keys=FAILURE_KEYS,
    ),
    "failures": SocketMethod(
        Level.READ,
        "Report what fails on purpose, and what could.",
        answer="a map",
        answer_keys={
            "allowed": "whether failures.allowed permits failures",
            "failing": "what fails now, as `fail` answers",
            "table": "every failure that can be caused: component, family, kind, does",
        },
    ),
}
