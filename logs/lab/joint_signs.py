"""Finds the signs of the joints' positions and currents, which differ from log to log.

A flipper moves down in insertion and backward in stance, so its angles fall there. In mud its motors do positive work
there, so the current has the sign of the change of angle. In air there is no such work: the sweep's current opposes dry
friction, so it has the direction of the motion; the adduction's current supports the weight of the arm in swing, and a
negative weight is impossible. A joint without such a motion keeps its logged signs.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from control.records import Phase
from logs.lab.columns import CURRENT_COLUMNS, PAPER_CONSTANT_NM_A
from logs.lab.findings import Finding, FindingKind, of_whole_log
from logs.lab.log_rows import LogRows, steps_inside

Floats = NDArray[np.float64]

PUSHING = (Phase.STANCE, Phase.INSERTION, Phase.STANCE, Phase.INSERTION)  # the phase in which each joint works on mud
SWEEP_MOTIONS = ((Phase.STANCE, -1.0),)  # with the sign of the change of angle; a body that moves drives some swings
ADDUCTION_MOTIONS = ((Phase.INSERTION, -1.0), (Phase.EXTRACTION, 1.0))
MOTIONS = (SWEEP_MOTIONS, ADDUCTION_MOTIONS) * 2
SHORTEST_TRAVEL_RAD = 0.05  # of a stroke whose torque is evaluated; less is tracking error
FRICTION_LIMIT_NM = 0.15  # the drives have no gears: their friction and cogging is 0.05 to 0.12 N·m in these logs
MUD_RATIO = 3.0  # of the torque in mud to that of friction
CONTRADICTION_NM = 2.0 * FRICTION_LIMIT_NM  # mud, or the body that the other flipper moves, drives a motor less
KNOWN_FRACTION = 0.75  # of a stroke's samples
COMPLETE_FRACTION = 0.5  # of the longest travel of a phase; shorter strokes were cut off
NEGATIVE_WEIGHT_NM = 0.03  # half the moment of the authors' arm; friction moves a hold by less
CLEAR_FRACTION = 0.75  # of the samples of a hold that agree about its sign


class Evidence(NamedTuple):
    """What distinguishes mud from air: the torques of the sweep in the middle of its travel."""

    stance_nm: float  # of the stance with the largest; NaN where none was evaluated
    swing_nm: float  # of the swing with the smallest: a flipper can be held by mud in the others

    @property
    def is_mud(self) -> bool:
        """Mud resists far more than friction does, or more than any friction of these drives."""
        friction_nm = min(float(np.nan_to_num(self.swing_nm)), FRICTION_LIMIT_NM)
        return self.stance_nm > max(FRICTION_LIMIT_NM, MUD_RATIO * friction_nm)


def orient(rows: LogRows, angle_rad: Floats, current_a: Floats) -> None:
    """Invert angles and currents where needed, in place; invalidate strides whose current has the wrong sign."""
    for joint, pushing in enumerate(PUSHING):
        if rows.change(angle_rad[:, joint], pushing) > 0.0:
            angle_rad[:, joint] *= -1.0
    evidence = find_evidence(rows, angle_rad, current_a)
    for joint in range(len(PUSHING)):
        angles, currents = angle_rad[:, joint], current_a[:, joint]
        find_sign = _sign_in_mud if evidence.is_mud else _sign_in_air
        sign = find_sign(rows, joint, angles, currents) or _work(rows, angles, currents, PUSHING[joint])
        if sign < 0.0:
            currents *= -1.0
    if evidence.is_mud:
        _check_holds(rows, current_a)
        _check_swings(rows, angle_rad, current_a, FRICTION_LIMIT_NM)
        _drop_contradictions(rows, angle_rad, current_a)
    else:
        rows.findings.append(_air(evidence))
        _check_swings(rows, angle_rad, current_a, 0.0)


def _work(rows: LogRows, angles: Floats, currents: Floats, wanted: Phase) -> float:
    """Return the motor's work in a phase in A·rad."""
    steps = np.diff(angles) * (currents[1:] + currents[:-1]) / 2.0
    return float(np.nansum(steps[steps_inside(rows.phase, wanted)]))


def find_evidence(rows: LogRows, angle_rad: Floats, current_a: Floats) -> Evidence:
    """Measure the sweeps' torques; the flippers are in the same mud."""
    sweeps = [(angle_rad[:, joint], current_a[:, joint]) for joint in range(0, angle_rad.shape[1], 2)]
    stances = [_middle_torques(rows, *sweep, Phase.STANCE) for sweep in sweeps]
    swings = [_middle_torques(rows, *sweep, Phase.SWING) for sweep in sweeps]
    stance_nm = max((abs(torque_nm) for each in stances for _, torque_nm in each), default=math.nan)
    swing_nm = min((abs(torque_nm) for each in swings for _, torque_nm in each), default=math.nan)
    return Evidence(stance_nm, swing_nm)


def _middle_torques(rows: LogRows, angles: Floats, currents: Floats, wanted: Phase) -> list[tuple[slice, float]]:
    """Return each stroke with its median torque in the middle half of its travel, by the paper's torque constant."""
    torques = []
    for stroke in rows.strokes(wanted):
        known = np.isfinite(angles[stroke]) & np.isfinite(currents[stroke])
        angle, current = angles[stroke][known], currents[stroke][known]
        travel_rad = float(np.ptp(angle)) if len(angle) else 0.0
        if travel_rad > SHORTEST_TRAVEL_RAD and np.mean(known) > KNOWN_FRACTION:
            middle = np.abs(angle - angle.min() - travel_rad / 2.0) < travel_rad / 4.0
            torques.append((stroke, PAPER_CONSTANT_NM_A * float(np.median(current[middle])) if middle.any() else 0.0))
    return torques


def _sign_in_mud(rows: LogRows, joint: int, angles: Floats, currents: Floats) -> float:
    """Return the strokes' vote on the sign of a current: one each, less where the torque may be friction."""
    votes = [
        float(np.clip(direction * torque_nm, -FRICTION_LIMIT_NM, FRICTION_LIMIT_NM))
        for phase, direction in MOTIONS[joint]
        for _, torque_nm in _middle_torques(rows, angles, currents, phase)
    ]
    return sum(votes)


def _sign_in_air(rows: LogRows, joint: int, angles: Floats, currents: Floats) -> float:
    """Return a number of the sign that makes a current physical in air; 0 where the log does not show it."""
    if PUSHING[joint] is Phase.INSERTION:
        return _hold_nm(rows, currents)
    medians = [
        [nm for _, nm in _middle_torques(rows, angles, currents, phase)] for phase in (Phase.SWING, Phase.STANCE)
    ]
    if not medians[1]:
        return 0.0
    forward_nm, backward_nm = (float(np.median(each)) if each else 0.0 for each in medians)
    return forward_nm - backward_nm


def _hold_nm(rows: LogRows, currents: Floats) -> float:
    """Return the median torque of the adduction in swing; 0 where its sign is not clear."""
    held = currents[rows.phase == Phase.SWING]
    held = held[np.isfinite(held)]
    median_a = float(np.median(held)) if len(held) else 0.0
    clear = len(held) and np.mean(np.sign(held) == np.sign(median_a)) >= CLEAR_FRACTION
    return PAPER_CONSTANT_NM_A * median_a if clear else 0.0


def _air(evidence: Evidence) -> Finding:
    if np.isnan(evidence.stance_nm):
        return of_whole_log(FindingKind.NO_MUD, "mud or air is not known: no stance has positions and currents")
    stance, swing = (f"{nm:.2f} N·m" if np.isfinite(nm) else "unknown" for nm in evidence)
    text = f"no evidence of mud: the sweep's torque in the middle of its travel is {stance} in stance, {swing} in swing"
    return of_whole_log(FindingKind.NO_MUD, text)


def _check_holds(rows: LogRows, current_a: Floats) -> None:
    """Report an adduction whose work on the mud and whose hold in swing contradict each other."""
    for joint in range(1, len(PUSHING), 2):
        hold_nm = _hold_nm(rows, current_a[:, joint])
        if hold_nm < -NEGATIVE_WEIGHT_NM:
            text = (
                f"by its work on the mud this sign gives the arm a negative weight: {hold_nm:.2f} N·m hold it in swing"
            )
            first = int(np.argmax(rows.phase == Phase.SWING))
            rows.report(FindingKind.SIGN, CURRENT_COLUMNS[joint], first, text)


def _check_swings(rows: LogRows, angle_rad: Floats, current_a: Floats, allowed_nm: float) -> None:
    """Report a sweep whose sign by its stances makes the motor brake in the swings."""
    for joint in range(0, len(PUSHING), 2):
        angles, currents = angle_rad[:, joint], current_a[:, joint]
        travel_rad = abs(float(rows.change(angles, Phase.SWING)))
        work_j = PAPER_CONSTANT_NM_A * _work(rows, angles, currents, Phase.SWING)
        has_stance = rows.change(angles, Phase.STANCE) != 0.0
        if has_stance and travel_rad > 0.0 and work_j < -allowed_nm * travel_rad:
            text = (
                f"by the stances' sign the motor does negative work in swing, {work_j:.2f} J: the sign is not certain"
            )
            first = int(np.argmax(rows.phase == Phase.SWING))
            rows.report(FindingKind.SIGN, CURRENT_COLUMNS[joint], first, text)


def _drop_contradictions(rows: LogRows, angle_rad: Floats, current_a: Floats) -> None:
    """Invalidate the current in strides in which the mud would push the flipper."""
    for joint, stroke, phase, torque_nm in list(_contradictions(rows, angle_rad, current_a)):
        text = f"the mud drives the motor in {phase.name.lower()}: {torque_nm:+.2f} N·m; left out in this stride"
        rows.report(FindingKind.SIGN, CURRENT_COLUMNS[joint], stroke.start, text)
        current_a[_stride_of(rows, stroke), joint] = np.nan


def _contradictions(rows: LogRows, angle_rad: Floats, current_a: Floats) -> Iterator[tuple[int, slice, Phase, float]]:
    """Yield joint, stroke, phase and torque where a torque beyond friction and weight opposes the motion."""
    for joint, motions in enumerate(MOTIONS):
        angles, currents = angle_rad[:, joint], current_a[:, joint]
        weight_nm = abs(_hold_nm(rows, currents)) if PUSHING[joint] is Phase.INSERTION else 0.0
        for phase, direction in motions:
            strokes = _middle_torques(rows, angles, currents, phase)
            travels_rad = [float(np.ptp(angles[stroke][np.isfinite(angles[stroke])])) for stroke, _ in strokes]
            for (stroke, torque_nm), travel_rad in zip(strokes, travels_rad, strict=True):
                complete = travel_rad > COMPLETE_FRACTION * max(travels_rad)
                if complete and direction * torque_nm < -CONTRADICTION_NM - weight_nm:
                    yield joint, stroke, phase, torque_nm


def _stride_of(rows: LogRows, stroke: slice) -> slice:
    """Return the rows from the insertion of a stroke's stride to the next insertion."""
    starts = [each.start for each in rows.strokes(Phase.INSERTION)]
    first = max((start for start in starts if start <= stroke.start), default=0)
    return slice(first, min((start for start in starts if start > stroke.start), default=len(rows.phase)))
