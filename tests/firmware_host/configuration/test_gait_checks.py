"""Gaits that no robot may walk: each is refused with one message that names phase, key and bound."""

import re
from dataclasses import replace
from typing import Any

import pytest

from control.geometry import FlipperGeometry
from control.mud_estimate import NOTHING_KNOWN, Coefficient
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.file_problems import ConfigurationError
from firmware_host.configuration.gait_checks import depth_problem, gait_problems
from firmware_host.configuration.gait_file import SHIPPED, gait_document, read_gait

NAMES = sorted(path.stem for path in SHIPPED.glob("*.toml"))


def point(sweep_deg: float, depth_m: float) -> dict[str, Any]:
    return {"sweep_deg": sweep_deg, "depth_m": depth_m}


def stroke(number: int = 1, **changes: Any) -> list[dict[str, Any]]:
    """Return the phases of a crutching stride at 3 cm, one of them changed; None removes a key."""
    phases: list[dict[str, Any]] = [
        {"name": "insertion", "speed_m_s": 0.1, "way_points": [point(30.0, 0.03)]},
        {"name": "stance", "speed_m_s": 0.3, "way_points": [point(-30.0, 0.03)]},
        {"name": "extraction", "speed_m_s": 0.3, "way_points": [point(-30.0, -0.0145)]},
        {"name": "swing", "duration_s": 0.8, "way_points": [point(30.0, -0.0145)]},
    ]
    phases[number] = {key: value for key, value in (phases[number] | changes).items() if value is not None}
    return phases


def problems(phases: list[dict[str, Any]], configuration: Configuration, **keys: Any) -> list[str]:
    path = read_gait({"name": "mine.toml", "phase": phases, **keys})
    return list(gait_problems(path, configuration, [0.03]))


@pytest.mark.parametrize("name", NAMES)
def test_the_gaits_that_ship_are_accepted(configuration: Configuration, name: str) -> None:
    path = read_gait(gait_document(name))
    assert not list(gait_problems(path, configuration, path.depths_m))


def test_a_depth_of_less_than_half_a_centimetre_is_refused(configuration: Configuration) -> None:
    assert depth_problem(configuration, 0.005) == ""
    assert depth_problem(configuration, 0.004).startswith("depth 0.4 cm: must be from 0.5 to 5 cm")


UNACCEPTED = {
    "reach": (stroke(way_points=[point(-30.0, 0.06)]), "phase 2 (stance).way_points"),
    "joint range": (stroke(way_points=[point(-70.0, 0.0)]), "phase 2 (stance).way_points"),
    "speed": (stroke(speed_m_s=None, duration_s=0.02), "phase 2 (stance).way_points"),
    "swing in mud": (stroke(2, way_points=[point(-30.0, 0.01)]), "phase 4 (swing).way_points"),
    "no end": (stroke(speed_m_s=None), "phase 2 (stance).duration_s"),
    "two ends": (stroke(duration_s=1.0), "phase 2 (stance).duration_s"),
    "no path": (stroke(way_points=[]), "phase 2 (stance).way_points"),
    "no depth": (stroke(way_points=[{"sweep_deg": -30.0}]), "phase 2 (stance).way_points 1"),
    "half an ellipse": (stroke(curve="half_ellipse"), "phase 2 (stance).way_points"),
    "condition of a swing": (stroke(3, until_force_n=1.0), "phase 4 (swing).until_force_n"),
    "swing out of the mud": (stroke(2, until_force_n=1.0), "phase 3 (extraction).until_force_n"),
    "swing after a pause": (
        [*stroke(2, until_force_n=1.0)[:3], {"name": "pause", "duration_s": 0.5}, stroke()[3]],
        "phase 3 (extraction).until_force_n",
    ),
    "depth of a phase that goes no deeper": (stroke(until_depth_m=0.02), "phase 2 (stance).until_depth_m = 0.02"),
    "swing of no time": (
        stroke(3, duration_s=None, speed_m_s=0.5, way_points=[point(-30.0, -0.0145)]),
        "phase 4 (swing).duration_s",
    ),
    "no swing": (stroke()[:3], "phase = insertion, stance, extraction"),
    "nothing": ([], "phase = none"),
}


@pytest.mark.parametrize("case", UNACCEPTED)
def test_a_wrong_gait_is_refused_with_file_phase_and_key(configuration: Configuration, case: str) -> None:
    phases, key = UNACCEPTED[case]
    assert problems(phases, configuration)[0].startswith(f"mine.toml: {key}")


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"way_points": [{"sweep": 30.0, "depth_m": 0.0}]}, "phase 2 (stance).way_points 1.sweep"),
        ({"way_points": [{"sweep_deg": 30.0, "depth": 0.0}]}, "phase 2 (stance).way_points 1.depth"),
        ({"way_points": [[30.0, 0.0]]}, "phase 2 (stance).way_points 1 = [30.0, 0.0]: must be a table"),
        ({"speed_m_s": 5.0}, "phase 2 (stance).speed_m_s = 5.0"),
        ({"name": "jump"}, "phase 2 (jump).name"),
    ],
)
def test_a_key_without_its_unit_or_out_of_bounds_is_named(changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ConfigurationError) as refused:
        read_gait({"name": "mine.toml", "phase": stroke(**changes)})
    assert any(each.startswith(f"mine.toml: {key}") for each in refused.value.problems)


def test_the_bound_of_a_height_out_of_reach_is_within_reach(configuration: Configuration) -> None:
    """Refused at least, since the arm may not rise as far: not as out of reach."""
    (problem, *_) = problems(stroke(3, way_points=[point(30.0, -0.2)]), configuration)
    (highest_cm,) = re.findall(r"out of reach, must be from (\S+) to 5.03 cm", problem)
    higher = problems(stroke(3, way_points=[point(30.0, float(highest_cm) / 100.0)]), configuration)
    assert higher and not any("out of reach" in each for each in higher)


def test_no_way_point_is_deeper_than_a_stride_may_be(configuration: Configuration) -> None:
    shallow = replace(configuration, adaptation=replace(configuration.adaptation, max_depth_m=0.03))
    assert not problems(stroke(), shallow)
    deeper = problems(stroke(way_points=[point(-30.0, 0.031)]), shallow)
    assert "must be at most 3 cm deep, adaptation.max_depth_m" in deeper[0]


def test_joints_of_other_torque_constants_may_have_the_same_torque(configuration: Configuration) -> None:
    weak = replace(configuration, limits=replace(configuration.limits, torque_nm=0.4))
    adduction = {
        joint: replace(each, torque_constant_nm_a=0.166)
        for joint, each in weak.drive.items()
        if joint.endswith("adduction")
    }
    assert not problems(stroke(), weak)
    assert not problems(stroke(), replace(weak, drive=weak.drive | adduction))


def test_mud_that_is_known_to_hold_the_flippers_too_hard_is_refused(configuration: Configuration) -> None:
    firm = Coefficient(8e6, 1e5, 1e5, 0.03, -0.5, 0.1, 3)
    path = read_gait({"name": "mine.toml", "phase": stroke()})
    (known,) = gait_problems(path, configuration, [0.03], NOTHING_KNOWN._replace(k_e=firm))
    assert known.startswith("mine.toml: phase 3 (extraction)") and "the mud of the walk before takes" in known


def test_a_phase_takes_no_more_current_than_the_force_that_ends_it(configuration: Configuration) -> None:
    """The insertion to 5 cm ends at 2 N in firm mud, where the extraction begins; after 4 N it takes too much."""
    firm, sticky = (Coefficient(value, 1e5, 1e5, 0.03, -0.3, 0.1, 3) for value in (5e6, 15e6))
    mud, document = NOTHING_KNOWN._replace(k_p=firm, k_e=sticky), gait_document("slow_insertion")
    found = []
    for until_force_n in (2.0, 4.0, None):
        document["phase"][0]["until_force_n"] = until_force_n
        found.append(list(gait_problems(read_gait(document), configuration, [0.05], mud)))
    assert [[re.findall(r"phase \d", each)[0] for each in problems] for problems in found] == [
        [],
        ["phase 3"],
        ["phase 1", "phase 3"],
    ]


@pytest.mark.parametrize(("until_depth_m", "phases"), [(0.02, []), (0.045, ["phase 1", "phase 3"])])
def test_a_phase_takes_no_more_current_than_at_the_depth_that_ends_it(
    configuration: Configuration, until_depth_m: float, phases: list[str]
) -> None:
    firm, document = Coefficient(2e6, 1e5, 1e5, 0.03, -0.3, 0.1, 3), gait_document("slow_insertion")
    document["phase"][0] |= {"until_force_n": 50.0, "until_depth_m": until_depth_m}
    mud = NOTHING_KNOWN._replace(k_p=firm, k_e=firm._replace(value=4e6))
    found = gait_problems(read_gait(document), configuration, [0.05], mud)
    assert [re.findall(r"phase \d", each)[0] for each in found] == phases


def test_a_gait_that_adapts_is_checked_at_every_depth_but_not_for_currents(configuration: Configuration) -> None:
    """An extraction at 0.8 m/s is too quick from 4.5 cm on. Firm mud that takes too much at 3 cm adapts the depth."""
    walking, quick = read_gait(gait_document("walking")), gait_document("walking")
    quick["phase"][2]["speed_m_s"] = 0.8
    assert not [*gait_problems(read_gait(quick), configuration, [0.03])]
    assert "rad/s" in next(gait_problems(read_gait(quick), configuration, []))
    firm = NOTHING_KNOWN._replace(k_p=Coefficient(5e6, 1e5, 1e5, 0.03, -0.3, 0.1, 3))
    assert " A " in next(gait_problems(walking, configuration, [0.03], firm))
    assert not [*gait_problems(walking, configuration, [], firm)]


def test_a_path_is_checked_at_its_shallowest_depth_too(configuration: Configuration) -> None:
    deeper = {"name": "stance", "duration_s": 0.03, "way_points": [point(30.0, 0.045)]}
    first = {"name": "insertion", "speed_m_s": 0.1, "way_points": [{"sweep_deg": 30.0, "depth_fraction": 1.0}]}
    path = read_gait({"phase": [first, deeper, *stroke()[2:]]})
    assert not [*gait_problems(path, configuration, [0.045])]
    assert "rad/s" in next(gait_problems(path, configuration, [0.045, 0.015]))


def test_flippers_that_push_in_turn_each_move_the_whole_body(configuration: Configuration) -> None:
    weak, quick = replace(configuration, limits=replace(configuration.limits, torque_nm=0.68)), stroke(speed_m_s=0.8)
    assert not problems(quick, weak)
    assert "of the sweep motor" in problems(quick, weak, right_offset_fraction=0.5)[0]


def test_conditions_belong_to_flippers_that_move_together(configuration: Configuration) -> None:
    phases = stroke(0, until_force_n=2.0)
    assert not problems(phases, configuration)
    assert problems(phases, configuration, right_offset_fraction=0.5)[0].startswith("mine.toml: phase 1 (insertion)")


@pytest.mark.parametrize(("plate_width_m", "crosses"), [(0.01, False), (0.1, True)])
def test_a_plate_may_not_cross_the_body(configuration: Configuration, plate_width_m: float, crosses: bool) -> None:
    rig = replace(configuration, geometry=FlipperGeometry(plate_width_m=plate_width_m))
    assert bool(problems(stroke(way_points=[point(-50.0, 0.025)], speed_m_s=0.05), rig)[:1]) is crosses
