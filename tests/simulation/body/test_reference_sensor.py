"""The reference sensor records the strokes of arms that a test moves, and of whole walks."""

from dataclasses import replace
from math import isnan

import numpy as np
import pytest

from control.controller import WalkOrder
from control.rate import PERIOD_S
from control.records import Phase
from firmware_host.configuration.configuration import Configuration
from firmware_host.configuration.gait_file import PROTOCOLS
from simulation.body.plant import Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.body.reference_sensor import StrideTruth, StrokeReference
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS, Clay
from simulation.mud.disturbances import Disturbances
from simulation.mud.track import Track
from simulation.mud.unevenness import Ridges
from simulation.test_rig.load_cell import measure_shear

DT_S = 0.01
INSERTION, STANCE, EXTRACTION, SWING = Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.SWING
STROKES = (INSERTION, STANCE, EXTRACTION)
SOFT = Track([(1.0, MUDS["53.1"])])


def make_plant(depth_m: float = 0.03) -> Plant:
    plant = Plant(PlantParameters(), Track([(1.0, MUDS["48.5"])]))
    for arm in plant.arms:
        arm.adduction_rad = arm.parameters.geometry.adduction_rad(0.0, depth_m)
    return plant


def watch(reference: StrokeReference, plant: Plant, *phases: Phase) -> list[StrideTruth]:
    """Run one tick in each phase; return the strides that closed."""
    return [truth for phase in phases for truth in reference.step(DT_S, plant, phase)]


@pytest.mark.parametrize(
    "strokes",
    [
        STROKES,
        (SWING, *STROKES),
        tuple(each for stroke in STROKES for each in (stroke, Phase.PAUSE)),
        (*STROKES, Phase.RECOVERY),  # a recovery is no stroke
    ],
)
def test_a_stride_of_each_flipper_closes_once_when_swing_or_the_next_insertion_begins(
    strokes: tuple[Phase, ...],
) -> None:
    reference, plant = StrokeReference(), make_plant()
    assert watch(reference, plant, *strokes) == []
    closed = watch(reference, plant, SWING)
    assert [(truth.flipper, truth.index) for truth in closed] == [("left", 0), ("right", 0)]
    assert watch(reference, plant, SWING) == []
    assert [truth.index for truth in watch(reference, plant, *STROKES, INSERTION)] == [1, 1]
    fresh = StrokeReference()
    assert repr(watch(fresh, plant, *STROKES, SWING)) == repr(closed)


@pytest.mark.parametrize(
    "phases",
    [
        (*STROKES, Phase.REST, SWING),
        (INSERTION, STANCE, SWING),
        (INSERTION, STANCE, Phase.REST, EXTRACTION, SWING),
        (STANCE, EXTRACTION, SWING),
    ],
)
def test_strides_that_are_cut_short_do_not_count(phases: tuple[Phase, ...]) -> None:
    reference, plant = StrokeReference(), make_plant()
    assert watch(reference, plant, *phases) == []
    assert [truth.index for truth in watch(reference, plant, *STROKES, SWING)] == [0, 0]


def test_a_reset_reference_sensor_counts_from_zero() -> None:
    reference, plant = StrokeReference(), make_plant()
    watch(reference, plant, *STROKES, SWING, INSERTION, STANCE)
    reference.reset()
    assert watch(reference, plant, EXTRACTION, SWING) == []
    assert [truth.index for truth in watch(reference, plant, *STROKES, SWING)] == [0, 0]


def test_means_are_those_of_the_part_in_the_mud_and_the_depth_is_the_greatest() -> None:
    reference, plant = StrokeReference(), make_plant()
    arm, geometry = plant.arms[0], plant.parameters.geometry
    poses = [
        (sweep_rad, geometry.adduction_rad(sweep_rad, depth_m))
        for sweep_rad, depth_m in ((0.9, -0.01), (0.2, 0.01), (0.4, 0.04), (0.6, 0.02))
    ]
    for arm.sweep_rad, arm.adduction_rad in poses:
        watch(reference, plant, INSERTION)
    left, _ = watch(reference, plant, STANCE, EXTRACTION, SWING)
    mean_rad = np.mean(poses[1:], axis=0)
    assert (left.insertion.sweep_rad, left.insertion.adduction_rad) == pytest.approx(mean_rad)
    assert left.insertion.deepest_m == pytest.approx(0.04)
    assert isnan(left.insertion.slip_m)


def test_the_speed_is_that_of_the_edge_through_the_mud_the_body_s_included() -> None:
    reference, plant = StrokeReference(), make_plant()
    arm, geometry = plant.arms[1], plant.parameters.geometry
    arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s, plant.body.forward_m_s = 0.4, -0.8, 0.1
    jacobian = np.reshape(geometry.jacobian(arm.sweep_rad, arm.adduction_rad), (3, 2))
    speed_m_s = np.linalg.norm(jacobian @ [0.4, -0.8] + [0.1, 0.0, 0.0])
    _, right = watch(reference, plant, *STROKES, SWING)
    assert right.insertion.speed_m_s == pytest.approx(speed_m_s)
    assert right.extraction.speed_m_s == pytest.approx(speed_m_s)


def test_in_stance_only_backward_slip_counts() -> None:
    reference, plant = StrokeReference(), make_plant()
    watch(reference, plant, INSERTION)
    length_m = plant.parameters.geometry.flipper_length_m
    for slip_m_s in (0.1, 0.3, 0.019, -0.5):
        plant.arms[0].sweep_velocity_rad_s = -(slip_m_s + 0.2) / length_m
        plant.body.forward_m_s = 0.2
        watch(reference, plant, STANCE)
    left, right = watch(reference, plant, EXTRACTION, SWING)
    assert left.stance.speed_m_s == pytest.approx(0.1 * 0.25 + 0.3 * 0.75)  # weighted by distance
    assert left.stance.slip_m == pytest.approx(DT_S * 0.4)
    assert left.stance.path_m == pytest.approx(DT_S * 0.919)  # all motion works the mud
    assert isnan(right.stance.speed_m_s)  # it went forward with the body
    assert right.stance.slip_m == 0.0


def test_a_stance_is_as_deep_as_the_plate_was_while_the_mud_yielded() -> None:
    """The plate rests at both ends of its arc, and has loaded the mud before that yields after 15 mm."""
    reference, plant = StrokeReference(), make_plant()
    arm, geometry = plant.arms[0], plant.parameters.geometry
    watch(reference, plant, INSERTION)
    for slip_m, depth_m in ((0.0, 0.01), (0.006, 0.02), (0.012, 0.03), (0.004, 0.034), (0.0, 0.05)):
        arm.adduction_rad = geometry.adduction_rad(arm.sweep_rad, depth_m)
        arm.sweep_velocity_rad_s = -slip_m / DT_S / geometry.flipper_length_m
        watch(reference, plant, STANCE)
    left, _ = watch(reference, plant, EXTRACTION, SWING)
    assert left.stance.mean_depth_m == pytest.approx(0.032)
    assert left.stance.speed_m_s == pytest.approx((1.2 * 0.012 + 0.4 * 0.004) / 0.016)
    assert (left.stance.deepest_m, left.stance.slip_m) == pytest.approx((0.05, 0.022))


def test_a_plate_that_sticks_and_slips_back_has_not_made_the_mud_yield() -> None:
    reference, plant = StrokeReference(), make_plant()
    arm, geometry = plant.arms[0], plant.parameters.geometry
    watch(reference, plant, INSERTION)
    for number in range(8):
        arm.adduction_rad = geometry.adduction_rad(arm.sweep_rad, 0.02 + 0.002 * number)
        arm.sweep_velocity_rad_s = (-1.0) ** (number + 1) * 0.01 / DT_S / geometry.flipper_length_m
        watch(reference, plant, STANCE)
    left, _ = watch(reference, plant, EXTRACTION, SWING)
    assert (left.stance.mean_depth_m, left.stance.slip_m) == pytest.approx((0.027, 0.04))


def test_a_flipper_in_the_air_has_no_strokes_to_repeat() -> None:
    left, right = watch(StrokeReference(), make_plant(-0.01), *STROKES, SWING)
    for *means, path_m in (left.insertion, left.stance, left.extraction, right.stance):
        assert np.isnan(means).all() and path_m == 0.0


def test_clay_and_surface_are_those_that_the_flipper_met_first() -> None:
    reference, plant = StrokeReference(), make_plant()
    arm = plant.arms[0]
    arm.ground, arm.history.surface_m = Clay("remoulded", 1234.0), 0.002
    watch(reference, plant, INSERTION)
    arm.ground, arm.history.surface_m = Clay("next", 2000.0), -0.001
    left, right = watch(reference, plant, STANCE, EXTRACTION, SWING)
    assert (left.ground, left.surface_m) == (Clay("remoulded", 1234.0), 0.002)
    assert (right.ground, right.surface_m) == (MUDS["48.5"], 0.0)
    assert left.insertion.deepest_m == pytest.approx(0.028)


def test_depths_and_surface_are_those_of_the_ridge_that_the_flipper_met() -> None:
    """The body is a quarter of a ridge ahead, so a crest of 4 mm lies under a flipper that points straight out."""
    plant = make_plant()
    plant.track = Track([(1.0, MUDS["48.5"])], ridges=Ridges(0.004, 0.2))
    for arm in plant.arms:
        arm.track = plant.track
        arm.step(1e-9, 0.05, 0.0, 0.0, 0.0)  # so short that nothing moves
    left, _ = watch(StrokeReference(), plant, *STROKES, SWING)
    assert left.surface_m == pytest.approx(-0.004)
    assert left.insertion.deepest_m == pytest.approx(0.03 + 0.004)


def observe_walk(lockstep: Lockstep, strides: int) -> tuple[list[StrideTruth], list[float]]:
    """Walk at 3 cm depth; return the truths of this number of strides of each flipper, and the left one's thrust in
    the middle of its stances.
    """
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03, adaptive=False))
    reference, arm = StrokeReference(), lockstep.robot.plant.arms[0]
    truths, thrusts_n = list[StrideTruth](), list[float]()
    while len(truths) < 2 * strides:
        lockstep.step()
        phase = lockstep.loop.target.phase
        truths += reference.step(PERIOD_S, lockstep.robot.plant, phase)
        if phase is STANCE and abs(arm.sweep_rad) < 0.2:
            thrusts_n.append(arm.force.thrust_n)
    lockstep.loop.learning.finish()  # the strides that have just ended
    return truths, thrusts_n


def test_a_load_cell_that_repeats_a_stance_measures_the_flipper_s_load(configuration: Configuration) -> None:
    lockstep = Lockstep(
        replace(configuration, gait=replace(PROTOCOLS["single_flipper"], pause_s=0.3)),
        SOFT,
        disturbances=Disturbances(surface_sd_m=0.0015, remoulding=1.0),
        fixed_base=True,
    )
    (first, _), thrusts_n = observe_walk(lockstep, 1)
    stance = first.stance
    shear_n = measure_shear(
        first.ground, configuration.geometry, stance.sweep_rad, stance.adduction_rad, stance.deepest_m, stance.speed_m_s
    )
    assert np.mean(thrusts_n) == pytest.approx(shear_n, rel=0.1)
