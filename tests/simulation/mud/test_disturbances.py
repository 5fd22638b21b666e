"""Each disturbance has its stated effect on the mud, the arm or the drives, and none if it is off."""

from dataclasses import fields, replace
from itertools import pairwise
from math import exp
from random import Random
from statistics import mean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.controller import WalkOrder
from control.faults import FaultKind
from control.gait.gait import SINGLE_FLIPPER
from control.geometry import FlipperGeometry
from control.modes import Mode
from control.parameters.fault_bounds import FaultBounds
from control.rate import PERIOD_S
from control.records import Joints, Phase
from firmware_host.configuration.configuration import Configuration
from simulation.body.plant import STEP_S, Arm, Plant
from simulation.body.plant_parameters import PlantParameters
from simulation.body.reference_sensor import StrideTruth, StrokeReference, snapshot_of
from simulation.harness.lockstep import Lockstep
from simulation.mud.clay import MUDS
from simulation.mud.disturbances import (
    CLINGING_ABOVE_EDGE_M,
    LAB,
    NONE,
    Disturbances,
    StrokeHistory,
    clinging_torques_nm,
    drive_changes,
)
from simulation.mud.track import Track

GEOMETRY = FlipperGeometry()
SOFT = Track([(5.0, MUDS["53.1"])])


def stroke(history: StrokeHistory, depth_m: float = 0.03, position_m: float = 0.0) -> None:
    """Move the plate from the air down to a depth and up again."""
    for lowest_m in (-0.014, 0.5 * depth_m, depth_m, 0.5 * depth_m, -0.014, -0.014):
        history.step(lowest_m, position_m)


def lowered(history: StrokeHistory, position_m: float = 0.0) -> StrokeHistory:
    history.step(-0.014, position_m)
    history.step(0.02, position_m)
    return history


def raise_again(history: StrokeHistory) -> None:
    for lowest_m in (0.01, -0.014, -0.014):
        history.step(lowest_m, 0.0)


def test_everything_is_off_by_default() -> None:
    assert all(getattr(NONE, field.name) == 0.0 for field in fields(NONE))
    assert drive_changes(NONE) == {}
    history = StrokeHistory(NONE, 1)
    for _ in range(5):
        stroke(history)
    assert (history.clinging_n, history.firmness, history.surface_m) == (0.0, 1.0, 0.0)


@given(st.floats(-0.6, 0.6), st.floats(-1.2, 0.5))
def test_clinging_mud_pulls_at_the_joints_as_a_weight_on_the_plate(sweep_rad: float, adduction_rad: float) -> None:
    """The reference is the difference of the weight's potential energy; the weight is 15 mm above the edge."""

    def energy_j(sweep: float, adduction: float) -> float:
        upright = replace(GEOMETRY, drop_m=GEOMETRY.drop_m - CLINGING_ABOVE_EDGE_M)
        return 0.7 * upright.edge_position(sweep, adduction)[2]

    step = 1e-6
    torques_nm = (
        -(energy_j(sweep_rad + step, adduction_rad) - energy_j(sweep_rad - step, adduction_rad)) / (2.0 * step),
        -(energy_j(sweep_rad, adduction_rad + step) - energy_j(sweep_rad, adduction_rad - step)) / (2.0 * step),
    )
    assert clinging_torques_nm(GEOMETRY, sweep_rad, adduction_rad, 0.7) == pytest.approx(torques_nm, abs=1e-7)


def test_mud_clings_from_the_first_extraction_on_until_the_next_one() -> None:
    history = StrokeHistory(Disturbances(clinging_n=0.7), 1)
    amounts_n = []
    for _ in range(6):
        before_n = history.clinging_n
        assert lowered(history).clinging_n == before_n
        raise_again(history)
        amounts_n.append(history.clinging_n)
    assert all(before_n != after_n for before_n, after_n in pairwise([0.0, *amounts_n]))
    assert all(0.6 * 0.7 <= amount_n <= 1.4 * 0.7 for amount_n in amounts_n)


def test_the_amounts_spread_evenly_by_forty_percent_around_their_mean() -> None:
    history, amounts_n = StrokeHistory(Disturbances(clinging_n=1.0), 1), []
    for _ in range(2000):
        stroke(history)
        amounts_n.append(history.clinging_n)
    assert mean(amounts_n) == pytest.approx(1.0, abs=0.02)  # four standard errors
    assert pstdev(amounts_n) == pytest.approx(0.4 / 3.0**0.5, rel=0.05)
    assert min(amounts_n) < 0.61
    assert max(amounts_n) > 1.39


def pulled_out(shaken_fraction: float, highest_m: float = 0.014) -> tuple[StrokeHistory, float]:
    """Return the history of a flipper above the mud after a stroke, and the weight of the mud that clings to it."""
    history = lowered(StrokeHistory(Disturbances(clinging_n=0.7, shaken_fraction=shaken_fraction), 1))
    history.step(-0.001, 0.0)
    weight_n = history.clinging_n
    history.step(-highest_m, 0.0)
    return history, weight_n


def test_mud_falls_off_on_the_way_down_in_proportion_to_it() -> None:
    history, weight_n = pulled_out(0.3)
    for height_m, part in ((0.014, 0.0), (0.0105, 0.25), (0.007, 0.5), (0.0, 1.0)):
        history.step(-height_m, 0.0)
        assert history.clinging_n == pytest.approx(weight_n * (1.0 - 0.3 * part))
    history.step(0.02, 0.0)
    assert history.clinging_n == pytest.approx(0.7 * weight_n)  # it stays constant in the mud until the next extraction


def test_mud_stays_while_the_flipper_rises_and_swings_and_what_fell_off_does_not_return() -> None:
    history, weight_n = pulled_out(0.3, 0.007)
    for height_m in (0.010, 0.014, 0.014, 0.014):
        history.step(-height_m, 0.0)
        assert history.clinging_n == weight_n
    for height_m in (0.007, 0.012, 0.014, 0.007):
        history.step(-height_m, 0.0)
        assert history.clinging_n == pytest.approx(0.85 * weight_n)
    for height_m in (0.028, 0.014):  # half of a longer path removes no more than before
        history.step(-height_m, 0.0)
    assert history.clinging_n == pytest.approx(0.85 * weight_n)


def test_a_plate_that_trembles_just_above_the_mud_loses_little() -> None:
    history, weight_n = pulled_out(1.0, 0.001)
    for height_m in (0.0008, 0.001, 0.0008):
        history.step(-height_m, 0.0)
    assert history.clinging_n == pytest.approx(weight_n * (1.0 - 0.0002 / 0.005))


def test_every_extraction_takes_new_mud_along_after_any_loss() -> None:
    shaken, steady = (
        StrokeHistory(Disturbances(clinging_n=0.7, shaken_fraction=fraction), 1) for fraction in (1.0, 0.0)
    )
    for _ in range(5):
        stroke(shaken)
        stroke(steady)
        assert shaken.clinging_n == steady.clinging_n > 0.0


@pytest.mark.parametrize(("depth_m", "clings"), [(0.004, False), (0.006, True)])
def test_a_touch_of_less_than_half_a_centimetre_is_no_stroke(depth_m: float, clings: bool) -> None:
    history = StrokeHistory(Disturbances(clinging_n=0.7, remoulding=1.0), 1)
    stroke(history, depth_m)
    assert (history.clinging_n > 0.0) is clings
    assert (lowered(history).firmness < 1.0) is clings


def test_strokes_at_the_same_position_find_softer_mud() -> None:
    history = StrokeHistory(Disturbances(remoulding=1.0), 1)
    for earlier in range(8):
        assert lowered(history).firmness == pytest.approx(0.5 + 0.5 * exp(-0.4 * earlier))
        raise_again(history)


def test_half_the_remoulding_softens_by_half() -> None:
    history = StrokeHistory(Disturbances(remoulding=0.5), 1)
    stroke(history)
    assert lowered(history).firmness == pytest.approx(1.0 - 0.25 * (1.0 - exp(-0.4)))


@pytest.mark.parametrize(("position_m", "earlier"), [(0.0, 1), (0.014, 1), (-0.014, 1), (0.016, 0), (-0.12, 0)])
def test_strokes_within_a_centimetre_and_a_half_share_their_mud(position_m: float, earlier: int) -> None:
    history = StrokeHistory(Disturbances(remoulding=1.0), 1)
    stroke(history)
    assert lowered(history, position_m).firmness == pytest.approx(0.5 + 0.5 * exp(-0.4 * earlier))


def test_a_stroke_s_position_is_that_of_its_entry_and_its_mud_stays_the_same() -> None:
    history = StrokeHistory(Disturbances(remoulding=1.0), 1)
    stroke(history)
    history.step(0.02, 0.0)
    for position_m in (0.0, -0.02, -0.06):  # like a flipper that slips
        history.step(0.02, position_m)
        assert history.firmness == pytest.approx(0.5 + 0.5 * exp(-0.4))
    history.step(-0.014, -0.06)
    assert lowered(history, -0.06).firmness == 1.0


def surfaces_m(history: StrokeHistory, strokes: int) -> list[float]:
    found_m = []
    for _ in range(strokes):
        found_m.append(lowered(history).surface_m)
        raise_again(history)
    return found_m


def test_every_stroke_meets_its_own_surface() -> None:
    found_m = surfaces_m(StrokeHistory(Disturbances(surface_sd_m=0.0015), 1), 2000)
    assert len(set(found_m)) == len(found_m)
    assert mean(found_m) == pytest.approx(0.0, abs=1.4e-4)  # four standard errors
    assert pstdev(found_m) == pytest.approx(0.0015, rel=0.07)


def test_the_surface_of_a_trial_moves_those_of_all_its_strokes() -> None:
    alone = StrokeHistory(Disturbances(surface_sd_m=0.0015), 1)
    moved = StrokeHistory(Disturbances(surface_sd_m=0.0015), 1, trial_surface_m=0.002)
    differences_m = [b - a for a, b in zip(surfaces_m(alone, 50), surfaces_m(moved, 50), strict=True)]
    assert differences_m == pytest.approx([0.002] * 50)


def test_a_trial_s_surface_is_common_to_both_flippers_and_scatters_from_trial_to_trial() -> None:
    found_m = []
    for seed in range(1000):
        plant = Plant(PlantParameters(disturbances=Disturbances(trial_surface_sd_m=0.001)), SOFT, Random(seed))
        left_m, right_m = (arm.surface_m for arm in plant.arms)
        assert left_m == right_m
        plant.reset()
        assert plant.arms[0].surface_m == left_m
        found_m.append(left_m)
    assert mean(found_m) == pytest.approx(0.0, abs=1.3e-4)  # four standard errors
    assert pstdev(found_m) == pytest.approx(0.001, rel=0.09)


def test_a_stroke_s_error_has_the_parts_of_trial_and_stroke() -> None:
    disturbances = Disturbances(surface_sd_m=0.0015, trial_surface_sd_m=0.0008)
    plants = [Plant(PlantParameters(disturbances=disturbances), SOFT, Random(seed)) for seed in range(1000)]
    assert pstdev(plant.arms[0].surface_m for plant in plants) == pytest.approx(disturbances.surface_error_m, rel=0.09)
    assert disturbances.surface_error_m == pytest.approx(0.0017)


def test_the_surface_stays_through_a_stroke_and_never_rises_over_a_plate_outside() -> None:
    history = StrokeHistory(Disturbances(surface_sd_m=0.003), 1)
    for _ in range(200):
        met_m = lowered(history).surface_m
        for lowest_m in (0.01, 0.03, 0.02, met_m + 1e-4):
            history.step(lowest_m, 0.0)
            assert history.surface_m == met_m
        for lowest_m in (met_m - 1e-5, met_m - 1e-5, -0.014):  # it stays just above the mud
            history.step(lowest_m, 0.0)
            assert lowest_m <= history.surface_m


def test_a_seed_repeats_its_history_after_a_reset_and_another_seed_differs() -> None:
    first, second, other = (StrokeHistory(LAB, seed) for seed in (1, 1, 2))
    found_m = surfaces_m(first, 5)
    assert surfaces_m(second, 5) == found_m
    assert surfaces_m(other, 5) != found_m
    first.reset()
    assert (first.clinging_n, first.firmness) == (0.0, 1.0)
    assert surfaces_m(first, 5) == found_m


def test_layers_do_not_change_each_other_s_draws() -> None:
    alone, together = StrokeHistory(Disturbances(surface_sd_m=LAB.surface_sd_m), 1), StrokeHistory(LAB, 1)
    assert surfaces_m(alone, 5) == surfaces_m(together, 5)


def single_flipper(
    configuration: Configuration, disturbances: Disturbances, track: Track = SOFT, pause_s: float = 0.1
) -> Lockstep:
    """Return a walking single flipper, faster and with shorter holds than the paper's, for a short test."""
    gait = replace(SINGLE_FLIPPER, stance_speed_m_s=0.3, extraction_speed_m_s=0.3, swing_speed_m_s=0.4, pause_s=pause_s)
    lockstep = Lockstep(replace(configuration, gait=gait), track, disturbances=disturbances, fixed_base=True)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03, adaptive=False))
    return lockstep


def until_phase(lockstep: Lockstep, phase: Phase) -> None:
    assert lockstep.run_until(lambda: lockstep.loop.target.phase is phase, 5.0)


def truths_of(lockstep: Lockstep, strides: int) -> list[StrideTruth]:
    """Return the truths of this number of strides of each flipper."""
    reference = StrokeReference()
    truths: list[StrideTruth] = []
    while len(truths) < 2 * strides:
        lockstep.step()
        truths += reference.step(PERIOD_S, lockstep.robot.plant, lockstep.loop.target.phase)
    return truths


def swing_currents_a(lockstep: Lockstep, strides: int) -> list[float]:
    """Return the left flipper's mean adduction current in each swing, after the current in air before the first one."""
    means_a = []
    for stride in range(strides):
        until_phase(lockstep, Phase.INSERTION)
        if stride == 0:  # raised as in swing
            means_a.append(lockstep.loop.states[1].current_a)
        until_phase(lockstep, Phase.SWING)
        currents_a = []
        while lockstep.loop.target.phase is Phase.SWING:
            lockstep.step()
            currents_a.append(lockstep.loop.states[1].current_a)
        means_a.append(mean(currents_a[len(currents_a) // 2 :]))
    return means_a


def test_clinging_mud_is_felt_in_swing_from_the_first_extraction_on(configuration: Configuration) -> None:
    firm = Track([(5.0, MUDS["48.5"])])  # the arms do not sink under their own weight before the walk
    clean_a = swing_currents_a(single_flipper(configuration, NONE, firm), 2)
    weighed_a = swing_currents_a(single_flipper(configuration, Disturbances(clinging_n=0.7), firm), 2)
    assert weighed_a[0] == clean_a[0]
    lever_m = 0.95 * configuration.geometry.flipper_length_m  # the mean over a swing from -30 to 30 degrees
    mean_a = 0.7 * lever_m / configuration.drive["left_adduction"].torque_constant_nm_a
    for clean, weighed in zip(clean_a[1:], weighed_a[1:], strict=True):
        assert 0.55 * mean_a < weighed - clean < 1.45 * mean_a


def test_clinging_mud_is_lighter_just_above_the_mud_than_at_the_end_of_the_swing(configuration: Configuration) -> None:
    firm = Track([(5.0, MUDS["48.5"])])
    lockstep = single_flipper(configuration, Disturbances(clinging_n=0.7, shaken_fraction=0.5), firm)
    history = lockstep.robot.plant.arms[0].history
    lockstep.run_until(lambda: lockstep.loop.target.phase is Phase.SWING, 20.0)
    lockstep.run_until(lambda: lockstep.loop.target.phase is not Phase.SWING, 20.0)
    before_n = history.clinging_n
    arm = lockstep.robot.plant.arms[0]
    edge_m = snapshot_of(arm, 0.0).depth_m
    assert edge_m < -0.005
    lockstep.run_until(lambda: snapshot_of(arm, 0.0).depth_m > 0.002, 20.0)
    assert history.clinging_n < 0.75 * before_n


def friction_nm(lockstep: Lockstep, joint: int) -> float:
    """Return the work of a motor divided by the travel of its joint, over two swings of the left flipper."""
    constant_nm_a = 0.083
    work_j = travel_rad = 0.0
    for _ in range(2):
        lockstep.run_until(lambda: lockstep.loop.target.phase is Phase.SWING, 20.0)
        while lockstep.loop.target.phase is Phase.SWING:
            before_rad = lockstep.robot.plant.angles_rad[joint]
            lockstep.step()
            turn_rad = lockstep.robot.plant.angles_rad[joint] - before_rad
            work_j += constant_nm_a * lockstep.loop.states[joint].current_a * turn_rad
            travel_rad += abs(turn_rad)
    return work_j / travel_rad


@pytest.mark.parametrize("torque_nm", [0.01, 0.05])
def test_the_sweep_motor_works_against_the_stated_friction(configuration: Configuration, torque_nm: float) -> None:
    without_nm = friction_nm(single_flipper(configuration, NONE), 0)
    with_nm = friction_nm(single_flipper(configuration, Disturbances(sweep_friction_nm=torque_nm)), 0)
    assert with_nm - without_nm == pytest.approx(torque_nm, abs=0.002)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(("field", "joint"), [("sweep_friction_nm", 0), ("adduction_friction_nm", 1)])
def test_friction_opposes_one_joint_in_each_direction(field: str, joint: int, direction: float) -> None:
    """It slows a joint as much as an opposing torque of the same size."""
    rates_rad_s = []
    for disturbances, torque_nm in ((NONE, -0.05 * direction), (Disturbances(**{field: 0.05}), 0.0)):
        plant = Plant(PlantParameters(disturbances=disturbances), SOFT)
        arm = plant.arms[0]
        arm.adduction_rad = 1.0  # far above the mud
        arm.sweep_velocity_rad_s = arm.adduction_velocity_rad_s = 10.0 * direction
        for _ in range(5):
            plant.step(STEP_S, Joints(*(torque_nm if each == joint else 0.0 for each in range(4))))
        rates_rad_s.append((arm.sweep_velocity_rad_s, arm.adduction_velocity_rad_s))
    assert rates_rad_s[0] == pytest.approx(rates_rad_s[1])


def test_friction_adds_to_that_of_the_plant_and_holds_a_resting_joint() -> None:
    parameters = PlantParameters(disturbances=Disturbances(sweep_friction_nm=0.03), joint_coulomb_nm=0.02)
    plant = Plant(parameters, SOFT)
    for arm in plant.arms:
        arm.adduction_rad = 1.0
    for torque_nm, moves in ((0.0499, False), (0.0501, True)):
        plant.step(STEP_S, Joints(torque_nm, 0.0, -torque_nm, 0.0))
        assert [arm.sweep_velocity_rad_s != 0.0 for arm in plant.arms] == [moves, moves]


def peak_thrusts_n(lockstep: Lockstep, strides: int) -> list[float]:
    arm, peaks_n = lockstep.robot.plant.arms[0], []
    for _ in range(strides):
        until_phase(lockstep, Phase.STANCE)
        forces_n = [0.0]
        while lockstep.loop.target.phase is Phase.STANCE:
            lockstep.step()
            forces_n.append(arm.force.thrust_n)
        peaks_n.append(max(forces_n))
    return peaks_n


def test_repeated_stances_lose_strength_and_force_as_the_logs_do(configuration: Configuration) -> None:
    """The logs lose 15 to 20 % per stroke at first; the pressure from the mud's weight is not remoulded."""
    lockstep = single_flipper(configuration, Disturbances(remoulding=1.0))
    remoulded_n, fractions = [], []
    for _ in range(4):
        remoulded_n += peak_thrusts_n(lockstep, 1)
        fractions.append(lockstep.robot.plant.arms[0].clay.strength_pa / MUDS["53.1"].strength_pa)
    assert fractions == pytest.approx([0.5 + 0.5 * exp(-0.4 * earlier) for earlier in range(4)])
    assert 0.10 < 1.0 - remoulded_n[1] / remoulded_n[0] < 0.20
    assert all(after_n < before_n for before_n, after_n in pairwise(remoulded_n))
    steady_n = peak_thrusts_n(single_flipper(configuration, NONE), 2)
    assert steady_n[1] == pytest.approx(steady_n[0], rel=0.02)


def held_thrust_n(lockstep: Lockstep) -> tuple[float, float]:
    """Return the thrust in the pause after the stance, at its beginning and 0.9 s later."""
    arm: Arm = lockstep.robot.plant.arms[0]
    until_phase(lockstep, Phase.STANCE)
    until_phase(lockstep, Phase.PAUSE)
    lockstep.run_for(0.05)  # to come to rest
    early_n = arm.force.thrust_n
    lockstep.run_for(0.9)
    return early_n, arm.force.thrust_n


def test_a_load_relaxes_in_the_holds(configuration: Configuration) -> None:
    """Relaxation comes in addition to the rate effect, by which mud loses load when a plate stops."""
    plain_early_n, plain_late_n = held_thrust_n(single_flipper(configuration, NONE, pause_s=1.0))
    for relaxation in (0.13, 0.3):
        early_n, late_n = held_thrust_n(single_flipper(configuration, Disturbances(relaxation=relaxation), pause_s=1.0))
        assert early_n == pytest.approx(plain_early_n, rel=0.02)
        assert late_n == pytest.approx((1.0 - relaxation) * plain_late_n, rel=0.08)  # the servo continues to push


def test_both_flippers_meet_their_own_surfaces_and_are_as_much_deeper(configuration: Configuration) -> None:
    truths = truths_of(single_flipper(configuration, Disturbances(surface_sd_m=0.003)), 3)
    assert len({truth.surface_m for truth in truths}) == len(truths)
    assert max(truth.surface_m for truth in truths) - min(truth.surface_m for truth in truths) > 0.003
    for truth in truths:
        assert truth.stance.deepest_m + truth.surface_m == pytest.approx(0.031, abs=0.002)  # the servo overshoots


def test_the_drives_take_over_their_part() -> None:
    disturbances = Disturbances(0.7, 1.0, 0.13, 0.0015, current_noise_a=0.3, sample_period_s=0.008, current_limit_a=9.0)
    assert drive_changes(disturbances) == {
        "current_noise_a": 0.3,
        "encoder_period_s": 0.008,
        "current_period_s": 0.008,
        "motor_current_limit_a": 9.0,
    }


def patient(configuration: Configuration) -> Configuration:
    """Return a configuration that tolerates rare messages, which would otherwise count as lost, and swinging joints."""
    return replace(configuration, faults=FaultBounds(late_s=0.02, quiet_s=0.02, jump_rad=1.0, fast_s=1.0))


def test_the_joints_stay_calm_in_the_lab(configuration: Configuration) -> None:
    """The disturbances of the authors' logs do not make the control loop oscillate."""
    spreads = []
    configuration = patient(configuration)
    for disturbances in (NONE, LAB):
        lockstep = Lockstep(configuration, Track([(5.0, MUDS["48.5"])]), disturbances=disturbances)
        lockstep.arm()
        lockstep.walk(WalkOrder(0.03, adaptive=False))
        until_phase(lockstep, Phase.INSERTION)
        until_phase(lockstep, Phase.SWING)
        rates_rad_s = []
        while lockstep.loop.target.phase is Phase.SWING:
            lockstep.step()
            rates_rad_s.append(lockstep.robot.plant.velocities_rad_s[1])
        spreads.append(pstdev(rates_rad_s))
    none, lab = spreads
    assert lab < none + 0.5


def test_a_loop_over_rare_messages_oscillates_and_is_stopped(configuration: Configuration) -> None:
    """With a message every 10 ms the joints oscillate with 10 rad/s even in air."""
    seldom = replace(LAB, sample_period_s=0.010)
    lockstep = Lockstep(patient(configuration), Track([(5.0, MUDS["48.5"])]), disturbances=seldom)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.03, adaptive=False))
    assert lockstep.run_until(lambda: lockstep.loop.mode in (Mode.DAMPING, Mode.FAULT), 5.0)
    assert {fault.kind for fault in lockstep.loop.faults.present} & {
        FaultKind.JOINT_OSCILLATING,
        FaultKind.JOINT_RUNAWAY,
    }


def test_the_current_is_as_noisy_as_stated(configuration: Configuration) -> None:
    deviations_a = []
    for noise_a in (0.0, 0.4):
        lockstep = Lockstep(configuration, SOFT, disturbances=Disturbances(current_noise_a=noise_a))
        lockstep.run_for(0.5)
        currents_a = []
        for _ in range(500):  # four idle drives
            lockstep.step()
            currents_a += [state.current_a for state in lockstep.loop.states]
        deviations_a.append(pstdev(currents_a))
    assert deviations_a == pytest.approx([0.1, 0.4], rel=0.07)  # the drive's own noise is 0.1 A


def test_rare_messages_are_read_in_many_ticks(configuration: Configuration) -> None:
    counts = []
    configuration = patient(configuration)
    for period_s in (0.0, 0.010):
        lockstep = Lockstep(configuration, SOFT, disturbances=Disturbances(sample_period_s=period_s))
        lockstep.run_for(0.5)
        readings = []
        for _ in range(380):
            lockstep.step()
            state = lockstep.loop.states[2]
            readings.append((state.angle_stamp_s, state.current_stamp_s))
        assert lockstep.loop.fault is None
        counts.append([len(set(stamps)) for stamps in zip(*readings, strict=True)])
    often, seldom = counts
    assert all(count > 370 for count in often)
    assert all(abs(count - 100) <= 2 for count in seldom)


def test_a_clipped_motor_cannot_lift_what_a_free_one_lifts(configuration: Configuration) -> None:
    stiff = Track([(5.0, MUDS["45.3"])])
    clipped = single_flipper(configuration, Disturbances(current_limit_a=5.0), stiff)
    free = single_flipper(configuration, NONE, stiff)
    (clipped_n,), (free_n,) = peak_thrusts_n(clipped, 1), peak_thrusts_n(free, 1)
    assert 0.5 * free_n < clipped_n < 0.7 * free_n


@pytest.mark.parametrize("water", MUDS)
def test_the_robot_walks_in_the_lab_without_a_fault(configuration: Configuration, water: str) -> None:
    lockstep = Lockstep(configuration, Track([(5.0, MUDS[water])]), disturbances=LAB)
    lockstep.arm()
    lockstep.walk(WalkOrder(0.04, adaptive=False))
    lockstep.run_for(3.0)
    assert lockstep.loop.mode is Mode.WALKING
    assert lockstep.robot.plant.body_m > 0.05


def test_the_lab_is_the_same_for_the_same_seed_and_another_for_another(configuration: Configuration) -> None:
    walks = []
    for seed in (3, 3, 4):
        lockstep = Lockstep(configuration, SOFT, seed, disturbances=LAB)
        lockstep.arm()
        lockstep.walk(WalkOrder(0.03, adaptive=False))
        walks.append(truths_of(lockstep, 1))
    assert repr(walks[0]) == repr(walks[1])
    surfaces = [{truth.surface_m for truth in walk} for walk in walks]
    assert not surfaces[0] & surfaces[2]
