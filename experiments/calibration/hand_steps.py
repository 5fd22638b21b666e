"""What an operator's hands show of each joint: its zero, its sign, its range, and the scale of its velocity.

No motor has torque meanwhile, so a wrong sign or zero moves nothing. Angles are measured as the configuration has them;
`hand_changes` computes what the configuration should say, and `check_hands` whether it says so.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import chain
from math import ceil, degrees, floor, inf, pi, radians
from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from experiments.bench.reading import BenchReading, BenchReadings, left_out
from experiments.bench.rest_pose_check import ZERO
from experiments.bench.stroke_tracking import velocity_scale
from experiments.bench.test_rig import POLL_S, TestRig, TickSample, signals
from experiments.calibration.joint_picture import draw_joint
from experiments.robot.bench_errors import BenchError
from experiments.robot.steps import OperatorStep, conduct_steps
from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON, REDO, Operator
from firmware_host.configuration.configuration import Configuration

ENDS = {
    "sweep": ("forward to its front stop", "back to its rear stop"),
    "adduction": ("up to its upper stop", "down to its lower stop"),
}
BEFORE, AGAIN = "redo the one before", "move this joint again"  # by the same key
STILL_S, STILL_RAD = 0.3, radians(1.0)
TURNING_RAD = 0.001  # in POLL_S: two codes of an encoder
LEAST_TURN_RAD = radians(30.0)
MOST_TRIES = 3
LEVEL_DEG = 5.0  # that a check allows to a hand: 1 cm at the end of an arm
SHIFTED_RAD = radians(2.0)  # of a zero: the error of a hand with a spirit level
SCALE_FRACTION = 0.05  # of a velocity's scale; ranges of two firmwares differ by 10 % and more
ROOM_DEG = 1.0  # of a limit to the stop
DIGITS = 5  # of a turn


class HandSteps:
    """Owns the samples of the prompt that is awaited."""

    def __init__(self, test_rig: TestRig, operator: Operator) -> None:
        self._test_rig, self._operator, self._hand = test_rig, operator, test_rig.operator.hand
        self._rig = test_rig.configuration.rig
        self._stretches: list[list[TickSample]] = []  # without a gap within each
        self._tries: Counter[str] = Counter()

    def steps(self, joints: Sequence[str]) -> list[OperatorStep]:
        flippers = dict.fromkeys(joint.partition("_")[0] for joint in joints)
        level = [
            OperatorStep(level_key(each), partial(self._ask_level, each), partial(self._read_level, each))
            for each in flippers
        ]
        ends = [
            OperatorStep(ends_key(each), partial(self._ask_front, each), partial(self._read_ends, each))
            for each in joints
        ]
        return level + ends

    def _ask_level(self, flipper: str) -> str:
        self._hand.hold()
        what = f"Hold the {flipper} flipper straight out to the side and level, and keep it there."
        return self._ask(flipper, what, BEFORE)

    def _read_level(self, flipper: str) -> Entry | None:
        joints = self._rig.joints[self._rig.joints_of(flipper)]
        angles_rad = [self._angle_at_rest(joint) for joint in joints]
        if None in angles_rad:
            return self._again(level_key(flipper), f"The {flipper} flipper moved: hold it still until the next prompt.")
        return dict(zip(joints, angles_rad, strict=True))

    def _ask_front(self, joint: str) -> str:
        self._stretches = []
        self._hand.hold()
        return self._turn(joint, 0)

    def _read_ends(self, joint: str) -> Entry | None:
        front_rad = self._angle_at_rest(joint)
        answer = self._turn(joint, 1)
        rear_rad = self._angle_at_rest(joint)
        self._hand.release()
        if answer == REDO:
            return None
        if front_rad is None or rear_rad is None:
            return self._again(ends_key(joint), f"{joint} moved at its stop: hold it still there.")
        if problem := self._turning_problem(joint, front_rad - rear_rad):
            return self._again(ends_key(joint), problem)
        scale = velocity_scale(self._stretches, self._rig.joints.index(joint))
        return {"front_rad": front_rad, "rear_rad": rear_rad, "velocity_scale": scale}

    def _turning_problem(self, joint: str, turned_rad: float) -> str:
        """Return why the motion is not that of the joint from stop to stop; empty where it is."""
        paths_rad = np.ptp(signals([*chain(*self._stretches)], "angle_rad"), axis=0)
        paths = dict(zip(self._rig.joints, paths_rad.tolist(), strict=True))
        other = max(paths, key=lambda each: paths[each])
        if other != joint and paths[other] > LEAST_TURN_RAD:
            return (
                f"{other} turned instead of {joint}: turn the right one, else exchange the node ids (or buses) of both."
            )
        if abs(turned_rad) < LEAST_TURN_RAD:
            least_deg = degrees(LEAST_TURN_RAD)
            return (
                f"{joint} turned by {degrees(abs(turned_rad)):.0f} degrees, which must be {least_deg:.0f} at least:"
                " turn it farther, else check its encoder."
            )
        return ""

    def _again(self, key: str, problem: str) -> Entry | None:
        """Report why a step is repeated. Raises BenchError after MOST_TRIES."""
        self._tries[key] += 1
        if self._tries[key] == MOST_TRIES:
            raise BenchError(problem)
        self._operator.report(problem)
        return None

    def _turn(self, joint: str, end: int) -> str:
        self._hand.turn(joint, -1.0 if end else 1.0)
        flipper, kind = joint.split("_")
        what = f"Move the {flipper} flipper slowly {ENDS[kind][end]}, hold it there, and turn nothing else."
        return self._ask(joint, what, AGAIN if end else BEFORE)

    def _ask(self, picture: str, what: str, redo: str) -> str:
        answers = {GO_ON: "it is there", REDO: redo}
        answer = self._operator.ask(f"{draw_joint(picture)}\n{what}", answers, self._watch)
        while self._hand.is_turning:
            self._watch()
        return answer

    def _watch(self) -> None:
        """Keep the samples in which a joint turns: a prompt may wait for hours."""
        stretch = self._test_rig.run_for(POLL_S)
        if np.ptp(signals(stretch, "angle_rad"), axis=0).max() > TURNING_RAD:
            self._stretches.append(stretch)

    def _angle_at_rest(self, joint: str) -> float | None:
        """Return nothing where the joint moves."""
        index = self._rig.joints.index(joint)
        self._stretches.append(self._test_rig.run_for(STILL_S))
        angles_rad = signals(self._stretches[-1], "angle_rad")[:, index]
        return None if np.ptp(angles_rad) > STILL_RAD else fmean(angles_rad)


def level_key(flipper: str) -> str:
    return f"{flipper}: level"


def ends_key(joint: str) -> str:
    return f"{joint}: ends"


def stops_deg(entries: Mapping[str, Entry], joint: str) -> tuple[float, float]:
    """Return the lower and the upper stop of a joint, by its right sign and zero."""
    front_rad, rear_rad = (entries[ends_key(joint)][end] for end in ("front_rad", "rear_rad"))
    zero_rad = _zero_rad(entries, joint)
    low_rad, high_rad = (rear_rad - zero_rad, front_rad - zero_rad)
    return (degrees(low_rad), degrees(high_rad)) if high_rad > low_rad else (-degrees(low_rad), -degrees(high_rad))


def _zero_rad(entries: Mapping[str, Entry], joint: str) -> float:
    """Return the angle of the level joint; zero where a hand cannot tell it from zero."""
    level_rad = float(entries[level_key(joint.partition("_")[0])][joint])
    return level_rad if abs(level_rad) > SHIFTED_RAD else 0.0


def hand_changes(configuration: Configuration, entries: Mapping[str, Entry]) -> dict[tuple[str, ...], Any]:
    """Return the configuration's new values by key. Raises BenchError for a speed whose scale is no key."""
    changes: dict[tuple[str, ...], Any] = {}
    ranges: dict[str, list[tuple[float, float]]] = {}
    for joint, drive in configuration.drive.items():
        if ends_key(joint) not in entries:
            continue
        ends = entries[ends_key(joint)]
        if ends["front_rad"] < ends["rear_rad"]:
            changes["drive", joint, "sign"] = -drive.sign
        if zero_rad := _zero_rad(entries, joint):
            changes["drive", joint, "zero_turn"] = round(drive.zero_turn + drive.sign * zero_rad / (2.0 * pi), DIGITS)
        if abs(ends["velocity_scale"] - 1.0) > SCALE_FRACTION:
            changes["drive", joint, "velocity_range_rad_s"] = _velocity_range(joint, drive, ends["velocity_scale"])
        ranges.setdefault(joint.partition("_")[2], []).append(stops_deg(entries, joint))
    for kind, stops in ranges.items():
        low_deg, high_deg = max(low for low, _ in stops), min(high for _, high in stops)
        if low_deg > getattr(configuration.limits, f"{kind}_min_deg"):
            changes["limits", f"{kind}_min_deg"] = float(ceil(low_deg + ROOM_DEG))
        if high_deg < getattr(configuration.limits, f"{kind}_max_deg"):
            changes["limits", f"{kind}_max_deg"] = float(floor(high_deg - ROOM_DEG))
    return changes


def _velocity_range(joint: str, drive: Any, scale: float) -> float:
    """Return the range of the drive's firmware. Raises BenchError for a drive without such a key."""
    if not hasattr(drive, "velocity_range_rad_s"):
        raise BenchError(
            f"{joint}: its angle turns {scale:.2f} times as fast as its reported velocity says: correct the settings of"
            " its encoder in the drive, then calibrate again with --restart."
        )
    return float(round(drive.ranges.velocity_rad_s * scale, 1))


def check_hands(test_rig: TestRig) -> BenchReadings:
    """Check every joint's zero, sign, range and velocity against the configuration."""
    joints, prompt = test_rig.configuration.rig.joints, test_rig.operator.prompt
    if prompt is None:
        yield from (left_out(f"{joint}: moved by hand") for joint in joints)
        return
    with TemporaryDirectory() as folder:
        notebook = Notebook(Path(folder), {})
        conduct_steps(HandSteps(test_rig, prompt).steps(joints), notebook, prompt, lambda done, total: None, {})
    for joint, span in zip(joints, test_rig.configuration.joint_ranges, strict=True):
        zero, ends = ZERO.format(joint=joint), notebook.entries[ends_key(joint)]
        level_deg = degrees(notebook.entries[level_key(joint.partition("_")[0])][joint])
        yield BenchReading(f"{joint}: held level and straight out", level_deg, "deg", -LEVEL_DEG, LEVEL_DEG, zero)
        front_deg, rear_deg = degrees(ends["front_rad"]), degrees(ends["rear_rad"])
        sign = f"it counts backward: change drive.{joint}.sign, and check its zero then"
        yield BenchReading(f"{joint}: turned forward or up", front_deg - rear_deg, "deg", 0.0, inf, sign)
        narrow = f"the limit lies beyond the stop: narrow [limits], check the counts of a turn in the drive, or {zero}"
        yield BenchReading(f"{joint}: lower stop", rear_deg, "deg", -inf, degrees(span.min_rad), narrow)
        yield BenchReading(f"{joint}: upper stop", front_deg, "deg", degrees(span.max_rad), inf, narrow)
        scale, advice = ends["velocity_scale"], f"calibrate {joint}: its velocity has another scale than its angle"
        yield BenchReading(
            f"{joint}: scale of its velocity", scale, "1", 1.0 - SCALE_FRACTION, 1.0 + SCALE_FRACTION, advice
        )
