"""Gaits from files: those that ship against the parameters and the curves that they stand for."""

from dataclasses import replace
from itertools import islice, pairwise
from math import hypot, radians

import pytest

from control.gait.gait import Gait
from control.gait.stride_table import crutching_parameters, stride_duration_s, stride_table
from control.geometry import FlipperGeometry
from control.parameters.gait_parameters import GaitParameters
from control.parameters.gait_path import GaitPath, GaitPhase, WayPoint
from control.rate import PERIOD_S
from control.records import GaitTarget, Phase
from estimation.stride_clock import STROKES
from firmware_host.configuration.gait_file import PROTOCOLS, SHIPPED, gait_document, read_gait

GEOMETRY = FlipperGeometry()
NAMES = sorted(path.stem for path in SHIPPED.glob("*.toml"))
DEPTH_M = 0.03


def load(name: str) -> GaitPath:
    return read_gait(gait_document(name))


def started(path: GaitPath | GaitParameters, depth_m: float = DEPTH_M) -> Gait:
    gait = Gait(GaitParameters(), GEOMETRY)
    gait.reset(depth_m, path)
    return gait


def targets(gait: Gait, count: int) -> list[GaitTarget]:
    return [gait.step(PERIOD_S) for _ in range(count)]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_the_file_of_a_protocol_commands_what_its_parameters_command(name: str) -> None:
    path, parameters = load(name), PROTOCOLS[name]
    assert crutching_parameters(path) == parameters
    count = int(2.2 * stride_duration_s(parameters, GEOMETRY, DEPTH_M) / PERIOD_S)
    assert targets(started(path), count) == targets(started(parameters), count)


def test_only_the_crutching_gait_has_its_parameters() -> None:
    known = {name for name in NAMES if crutching_parameters(load(name))}
    assert known == {*PROTOCOLS, "three_depths"}
    assert load("three_depths").phase == load("measuring").phase


@pytest.mark.parametrize("name", NAMES)
def test_no_gait_jumps_and_velocities_are_the_changes_of_position(name: str) -> None:
    gait = started(load(name))
    path = targets(gait, int(2.2 * stride_duration_s(load(name), GEOMETRY, DEPTH_M) / PERIOD_S))
    assert path[-1].stride >= 1
    for before, after in pairwise(path):
        for value, rate in (("sweep_rad", "sweep_velocity_rad_s"), ("depth_m", "depth_velocity_m_s")):
            mean = (getattr(before, rate) + getattr(after, rate)) / 2.0
            assert getattr(after, value) - getattr(before, value) == pytest.approx(mean * PERIOD_S, abs=2e-3)


def test_an_elliptic_stroke_lies_on_its_ellipse() -> None:
    stroke = [target for target in targets(started(load("ellipse")), 300) if target.phase is Phase.STROKE]
    ends_m = -0.5 * GEOMETRY.clearance_m
    for target in stroke:
        along, down = target.sweep_rad / radians(35.0), (target.depth_m - ends_m) / (DEPTH_M - ends_m)
        assert along**2 + down**2 == pytest.approx(1.0)
    assert max(target.depth_m for target in stroke) == pytest.approx(DEPTH_M, abs=1e-5)


def test_only_pure_phases_in_order_keep_their_names_for_the_estimator() -> None:
    reported = {name: [row.phase for row in stride_table(load(name), GEOMETRY, DEPTH_M)] for name in NAMES}
    assert reported["backward"] == reported["walking"] == [*STROKES, Phase.SWING]
    assert reported["ellipse"] == [Phase.STROKE, Phase.SWING]
    assert Phase.INSERTION not in reported["slow_insertion"]


def test_no_step_reaches_a_swing_over_a_brief_row_before_anybody_looks_whether_the_flippers_are_out() -> None:
    crutching = load("walking")
    *before, extraction, swing = crutching.phase
    brief = replace(extraction, way_points=(*extraction.way_points, WayPoint(-30.02, depth_fraction=-1.0)))
    gait = started(replace(crutching, phase=(*before, brief, swing)))
    for _ in range(600):
        target = gait.step(3.0 * PERIOD_S, may_swing=not gait.swing_is_near)
    assert gait.waits and target.phase is not Phase.SWING


def test_a_phase_after_one_that_ended_early_stays_within_reach() -> None:
    lines = GaitPhase("insertion", (WayPoint(-30.0, depth_m=0.03), WayPoint(40.0, depth_m=0.01)), speed_m_s=0.1)
    arc = GaitPhase("stance", (WayPoint(-20.0, depth_m=0.037), WayPoint(-5.0, depth_m=0.026)), "half_ellipse", 0.1)
    gait = started(GaitPath((lines, arc, *load("walking").phase[-2:])))
    while gait.step(PERIOD_S).depth_m < 0.029:
        pass
    assert gait.end_phase()
    for target in targets(gait, 1000):
        assert GEOMETRY.is_reachable(target.sweep_rad, target.depth_m - 1e-9)


def test_one_phase_that_is_not_pure_makes_strokes_of_all() -> None:
    crutching = load("walking")
    oblique = replace(crutching.phase[0], way_points=(WayPoint(25.0, depth_fraction=1.0),))
    path = replace(crutching, phase=(oblique, *crutching.phase[1:]))
    assert [row.phase for row in stride_table(path, GEOMETRY, DEPTH_M)] == [*[Phase.STROKE] * 3, Phase.SWING]


def test_after_an_early_end_a_pause_rests_and_the_next_phase_keeps_its_speed() -> None:
    insertion, stance, extraction, swing = load("walking").phase
    gait = started(GaitPath((insertion, stance, GaitPhase("pause", duration_s=0.2), extraction, swing)))
    while (ended := gait.step(PERIOD_S)).sweep_rad > radians(15.0):
        pass
    assert gait.end_phase()
    rest, rise = targets(gait, 75), targets(gait, 75)
    assert {(each.sweep_rad, each.depth_m) for each in rest} == {(ended.sweep_rad, ended.depth_m)}
    speeds_m_s = [hypot(0.12 * each.sweep_velocity_rad_s, each.depth_velocity_m_s) for each in rise]
    assert 0.5 < max(speeds_m_s) < 0.7  # its mean is 0.5 m/s


def test_a_way_point_that_an_early_end_left_is_reached_by_the_next_phase() -> None:
    down = WayPoint(30.0, depth_m=DEPTH_M)
    phases = [GaitPhase("insertion", (down,), speed_m_s=speed_m_s) for speed_m_s in (0.2, 0.02)]
    gait = started(GaitPath((*phases, *load("walking").phase[1:])))
    while gait.step(PERIOD_S).depth_m < 0.01:
        pass
    assert gait.end_phase()
    slow = targets(gait, 300)
    assert slow[-1].depth_m == pytest.approx(0.01 + 0.02 * 300 * PERIOD_S, abs=0.001)
    assert {each.sweep_rad for each in slow} == {radians(30.0)}


@pytest.mark.parametrize(("name", "after_s", "depth_m"), [("slow_insertion", 2.0, 0.05), ("ellipse", 0.2, 0.03)])
def test_a_phase_that_ends_early_is_followed_from_where_it_ended(name: str, after_s: float, depth_m: float) -> None:
    gait = started(load(name), depth_m)
    last = targets(gait, int(after_s / PERIOD_S))[-1]
    assert gait.end_phase()
    nexts = list(islice(iter(lambda: gait.step(PERIOD_S), None), 100))
    assert nexts[0].depth_m == pytest.approx(last.depth_m, abs=1e-4)
    assert nexts[0].sweep_rad == pytest.approx(last.sweep_rad, abs=1e-3)
    if name == "slow_insertion":  # the stride continues at the depth that was reached
        assert gait.commanded_depth_m == last.depth_m
        assert nexts[-1].depth_m == pytest.approx(last.depth_m)
