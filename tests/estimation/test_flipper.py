"""Strokes through synthetic mud that keeps the estimator's own laws, so that the truth is known to the last digit.

The joints follow the gait exactly. The currents carry k_p Φ, k_s Ψ and k_e Φ of plate_integrals.py on the true surface,
the load on the plate's face, gravity, inertia, friction and clinging mud. Without noise only two errors remain: strokes
are averaged over pieces of travel, and the surface has to be found first. The law bends a line of force against depth
by 3 % at 2 cm, 8 % at 3 cm and 20 % at 4 cm (the plate leans more, the deeper it is), which looks like a surface that
is too deep. Tests that need the laws without this error state the surface beforehand.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise
from math import copysign, cos, inf, isfinite, nan, radians, sin
from typing import NamedTuple

import numpy as np
import pytest

from control.gait.recovery import OUT_M, is_in_mud, lowest_point_m
from control.joint_friction import JointFriction
from control.parameters.arm_mass import ArmMass
from control.parameters.gait_parameters import GaitParameters
from control.plate_integrals import cross_coupling, stance_moment_m4, stroke_moment_m4, submerged_plate
from control.records import NO_LOAD, Estimate, Phase, StrideEstimate
from estimation.flipper import FlipperEstimator
from estimation.force_map import smallest_force_n
from estimation.joint_load import CLINGING_M, FlipperDrive
from estimation.stride_estimator import GRACE_S
from estimation.strokes.shear import Base
from firmware_host.configuration.gait_file import PROTOCOLS
from tests.estimation import synthetic_strides
from tests.estimation.synthetic_strides import GEOMETRY, RATE_HZ, Moment, Row, strides_of, update, walked

GAIT = GaitParameters(swing_duration_s=0.25)  # a short swing: nothing happens in it
LENGTH_M, DROP_M = GEOMETRY.flipper_length_m, GEOMETRY.drop_m
FRICTION = JointFriction(0.01, 0.002, 0.01, 14, 20.0)
WEIGHTLESS = FlipperDrive(synthetic_strides.WEIGHTLESS, 0.083, 0.09)
HEAVY = FlipperDrive(ArmMass(0.3, 0.07, 0.0004, 0.0006), 0.083, 0.09, FRICTION, FRICTION)
KNOWN_M = 1e-6  # uncertainty of a surface that is practically known
NOISE_A = 0.2  # the authors' logs show 0.1 to 0.3


class Mud(NamedTuple):
    k_p: float = 1.0e6  # N/m³
    k_s: float = 0.6e6
    k_e: float = 0.7e6
    surface_m: float = 0.0
    face_fraction: float = 0.0  # of the stance's load that the face also carries in insertion and extraction
    weight_n: float = 0.0  # clings to the flipper
    friction_nm: float = 0.0  # dry, of both joints

    def times(self, factor: float) -> "Mud":
        return self._replace(k_p=factor * self.k_p, k_s=factor * self.k_s, k_e=factor * self.k_e)


MUD = Mud()


@cache
def motion(depth_m: float = 0.03, gait: GaitParameters = GAIT, strides: int = 1) -> tuple[Moment, ...]:
    """Return whole strides, from the swing before the first one to the sample that closes the last."""
    moments = walked(depth_m, gait, strides + 1)
    first, *_, last = (i for i, (a, b) in enumerate(pairwise(moments), 1) if a.phase is not b.phase is Phase.SWING)
    return moments[first : last + 1]


def mud_torques_nm(moment: Moment, mud: Mud) -> tuple[float, float]:
    """Return the torques of the mud on (sweep, adduction), by the laws."""
    plate = submerged_plate(GEOMETRY, moment.sweep_rad, moment.adduction_rad, mud.surface_m)
    stance_nm = mud.k_s * stance_moment_m4(GEOMETRY, plate)
    stroke_m4 = stroke_moment_m4(GEOMETRY, plate, moment.sweep_rad)
    fraction, k = {
        Phase.INSERTION: (mud.face_fraction, mud.k_p),
        Phase.STANCE: (1.0, 0.5 * mud.k_p),  # any upward load in stance must not matter
        Phase.EXTRACTION: (-mud.face_fraction, -mud.k_e),
    }.get(moment.phase, (0.0, 0.0))
    sweep_nm = fraction * stance_nm
    return sweep_nm, k * stroke_m4 + cross_coupling(GEOMETRY, plate, moment.sweep_rad) * sweep_nm


def clinging_torques_nm(moment: Moment, mud: Mud) -> tuple[float, float]:
    """Return the torques of clinging mud, -W ∂z/∂q, and of dry friction.

    The weight acts CLINGING_M above the edge, at the height l cos α sin β - (h - CLINGING_M) cos β.
    """
    sa, ca, sb, cb = (trig(angle) for angle in (moment.sweep_rad, moment.adduction_rad) for trig in (sin, cos))
    sweep_nm, adduction_nm = (
        -copysign(mud.friction_nm, speed_rad_s) if speed_rad_s else 0.0
        for speed_rad_s in (moment.sweep_rad_s, moment.adduction_rad_s)
    )
    lever_m = LENGTH_M * ca * cb + (DROP_M - CLINGING_M) * sb
    return sweep_nm + mud.weight_n * LENGTH_M * sa * sb, adduction_nm - mud.weight_n * lever_m


def rows_of(moments: Iterable[Moment], mud: Mud = MUD, drive: FlipperDrive = WEIGHTLESS) -> list[Row]:
    def torques_nm(moment: Moment) -> tuple[float, float]:
        laws, clinging = mud_torques_nm(moment, mud), clinging_torques_nm(moment, mud)
        return laws[0] + clinging[0], laws[1] + clinging[1]

    return synthetic_strides.loaded(moments, torques_nm, drive)


def noisy(rows: Sequence[Row], seed: int, noise_a: float = NOISE_A) -> list[Row]:
    return synthetic_strides.noisy(rows, seed, noise_a)


def estimator(drive: FlipperDrive = WEIGHTLESS, surface_error_m: float = 0.001) -> FlipperEstimator:
    return FlipperEstimator("left", GEOMETRY, drive, Base.FIXED, 2.5, surface_error_m)


def waiting(rows: Sequence[Row]) -> list[Row]:
    """Let the flipper stay where its extraction ended, for longer than the time that it has to come out."""
    lifted_rad, ticks = rows[-2].adduction.angle_rad, round(1.1 * GRACE_S * RATE_HZ)
    assert rows[-2].phase is not rows[-1].phase is Phase.SWING
    return [*rows[:-1], *(later(rows[-1], tick / RATE_HZ, lifted_rad) for tick in range(ticks))]


def closed(rows: Iterable[Row], flipper: FlipperEstimator | None = None) -> list[StrideEstimate]:
    return strides_of(rows, flipper or estimator())


def one(rows: Iterable[Row], flipper: FlipperEstimator | None = None) -> StrideEstimate:
    (stride,) = closed(rows, flipper)
    return stride


def coefficients(stride: StrideEstimate) -> tuple[Estimate, Estimate, Estimate]:
    return stride.k_p, stride.k_s, stride.k_e


def ratios(stride: StrideEstimate, mud: Mud) -> list[float]:
    return [each.value / truth for each, truth in zip(coefficients(stride), mud[:3], strict=True)]


# the laws are found


@pytest.mark.parametrize("drive", [WEIGHTLESS, HEAVY])
@pytest.mark.parametrize(
    ("depth_m", "gait"), [(0.02, PROTOCOLS["single_flipper"]), (0.03, GAIT), (0.04, PROTOCOLS["single_flipper"])]
)
def test_where_the_surface_is_known_shear_and_extraction_are_found(
    depth_m: float, gait: GaitParameters, drive: FlipperDrive
) -> None:
    """The tolerance of 0.1 % covers batches of 6 mm on a law that is not quite a line. k_e has 1 %: the bend of the
    insertion also leaves a level of up to 10 mN for the zero, and a tick of the quick extraction is 3 % of its ramp's
    sine.
    """
    mud = MUD._replace(face_fraction=0.3)
    stride = one(rows_of(motion(depth_m, gait), mud, drive), estimator(drive, KNOWN_M))
    assert stride.k_s.valid and stride.k_e.valid
    assert stride.k_s.value == pytest.approx(mud.k_s, rel=1e-3)
    assert stride.k_e.value == pytest.approx(mud.k_e, rel=1e-2)


@pytest.mark.parametrize("surface_m", [-0.003, 0.0, 0.003])
@pytest.mark.parametrize(
    ("factor", "depth_m"), [(1.0, 0.04), (0.4, 0.02), (0.4, 0.03), (1.0, 0.025), (3.0, 0.02), (3.0, 0.03)]
)
def test_without_prior_knowledge_and_noise_all_error_is_that_of_the_surface(
    factor: float, depth_m: float, surface_m: float
) -> None:
    """The surface is found to 0.8 mm up to 3 cm; mud softer than 0.4 times pushes at 17 mm as little as friction. An
    error dδ of the surface changes k_p and k_e by 3/2 dδ/z and k_s by 2 dδ/z, up to 6 %. The correction is of first
    order in dδ/z, so its square remains; the first quarter of the rise is not fitted, so k_e changes by more than
    3/2 dδ/z.
    """
    mud = MUD.times(factor)._replace(surface_m=surface_m)
    stride = one(rows_of(motion(depth_m), mud), estimator(surface_error_m=0.05))
    error_m = stride.surface_m - surface_m
    late = error_m / (depth_m - surface_m)
    assert all(each.valid for each in coefficients(stride))
    assert stride.depth_m == pytest.approx(depth_m - stride.surface_m, abs=1e-5)
    if depth_m <= 0.03:
        assert abs(error_m) < 0.8e-3
        assert ratios(stride, mud) == pytest.approx([1.0, 1.0, 1.0], abs=0.06)
    for ratio, power, tolerance in zip(ratios(stride, mud), (1.5, 2.0, 1.5), (0.01, 0.003, 0.03), strict=True):
        assert ratio * (1.0 - late) ** power == pytest.approx(1.0, abs=tolerance)


# the zero


def test_mud_that_clings_and_its_drift_are_reported() -> None:
    """The tolerance of 0.02 N is a hundredth of the force of the insertion, whose bend leaves a level."""
    single = motion(strides=1)
    weights_n, period_s = (0.7, 1.1, 0.9), single[-1].now_s - single[0].now_s
    rows = [
        row
        for turn, weight_n in enumerate(weights_n)
        for row in rows_of(
            (moment._replace(now_s=moment.now_s + turn * period_s) for moment in single[:-1]),
            MUD._replace(weight_n=weight_n, friction_nm=0.02),
        )
    ]
    strides = closed([*rows, rows[0]._replace(now_s=rows[-1].now_s + 1.0 / RATE_HZ)])
    assert [stride.tare_n for stride in strides] == pytest.approx(weights_n, abs=0.02)
    first, *later = [stride.tare_drift_n for stride in strides]
    assert not isfinite(first)
    assert later == pytest.approx([0.4, -0.2], abs=2e-3)  # half of a swing's first sample belongs to the stride before


@pytest.mark.parametrize(("weight_n", "friction_nm"), [(0.7, 0.0), (0.0, 0.02), (1.5, 0.06)])
def test_clinging_mud_and_dry_friction_change_no_coefficient(weight_n: float, friction_nm: float) -> None:
    clean, dirty = (
        one(rows_of(motion(), mud)) for mud in (MUD, MUD._replace(weight_n=weight_n, friction_nm=friction_nm))
    )
    for a, b in zip(coefficients(clean), coefficients(dirty), strict=True):
        assert b.value == pytest.approx(a.value, rel=2e-3)  # friction is measured to 1 %, levers are means of 2.6 ms
        assert b.std_error == pytest.approx(a.std_error, rel=1e-2)


def test_without_air_before_it_the_insertion_itself_gives_the_zero() -> None:
    """The walk begins with an insertion: its path down to the mud shows 0.7 N of clinging mud to a tenth of a newton,
    which is 5 % of k_p. Uncorrected, the weight would be a third of k_p.
    """
    rows = [row for row in rows_of(motion(), MUD._replace(weight_n=0.7)) if row.phase is not Phase.SWING]
    stride = one([*rows, rows_of(motion())[-1]])
    assert stride.tare_n == pytest.approx(0.7, abs=0.1)
    assert stride.k_p.value == pytest.approx(one(rows_of(motion())).k_p.value, rel=0.05)


# messages: repeated, seldom, lost, wild


@pytest.mark.parametrize("times", [2, 7])
def test_rows_that_repeat_change_neither_value_nor_uncertainty(times: int) -> None:
    """Only the time at which a batch ends may change, and only the batch's speed shows it."""
    rows = noisy(rows_of(motion(), MUD, HEAVY), 3)
    step_s = 1.0 / RATE_HZ / times
    repeated = [row._replace(now_s=row.now_s + again * step_s) for row in rows for again in range(times)]
    plain, again = (one(each, estimator(HEAVY)) for each in (rows, repeated[: 1 - times]))
    for a, b in zip(coefficients(plain), coefficients(again), strict=True):
        assert b == a


@pytest.mark.parametrize("ticks", [3, 10])
def test_slow_messages_change_value_and_error_little(ticks: int) -> None:
    """The messages come 190 to 38 times a second. A tenth of the messages has √10 of the noise; with 0.02 A that is
    negligible compared with the torque constants' 3.2 %.
    """
    rows = noisy(rows_of(motion(gait=PROTOCOLS["single_flipper"]), MUD, HEAVY), 3, 0.02)
    held = [rows[i - i % ticks]._replace(now_s=row.now_s, phase=row.phase) for i, row in enumerate(rows)]
    plain, seldom = (one(each, estimator(HEAVY)) for each in (rows, held))
    for a, b in zip(coefficients(plain), coefficients(seldom), strict=True):
        assert abs(b.value - a.value) < a.std_error
        assert b.std_error == pytest.approx(a.std_error, rel=0.5)


@pytest.mark.parametrize("bad", [nan, inf])
@pytest.mark.parametrize("joint", ["sweep", "adduction"])
@pytest.mark.parametrize("field", ["angle_rad", "current_a"])
def test_samples_that_are_not_finite_are_skipped(joint: str, field: str, bad: float) -> None:
    rows = rows_of(motion(), MUD, HEAVY)
    between = [each for row in rows for each in (row, _invalid(row, joint, field, bad))]
    assert repr(one(between, estimator(HEAVY))) == repr(one(rows, estimator(HEAVY)))
    assert update(estimator(), *_invalid(rows[0], joint, field, bad)) == (NO_LOAD, None)


def _invalid(row: Row, joint: str, field: str, bad: float) -> Row:
    invalid = getattr(row, joint)._replace(**{field: bad})
    return row._replace(sweep=invalid) if joint == "sweep" else row._replace(adduction=invalid)


@pytest.mark.parametrize("lost", [5, 20])
def test_a_gap_in_each_stroke_moves_no_coefficient_by_more_than_its_uncertainty(lost: int) -> None:
    """The gaps last 13 and 52 ms: less and more than LONGEST_GAP_S, up to which two samples belong to one motion."""
    rows = rows_of(motion(gait=PROTOCOLS["single_flipper"]), MUD, HEAVY)
    whole = one(rows, estimator(HEAVY))
    gaps = {i for phase in (1, 2, 3) for i in _middle(rows, Phase(phase), lost)}
    pierced = one((row.lost() if i in gaps else row for i, row in enumerate(rows)), estimator(HEAVY))
    for a, b in zip(coefficients(whole), coefficients(pierced), strict=True):
        assert b.valid
        assert abs(b.value - a.value) < a.std_error


def _middle(rows: Sequence[Row], phase: Phase, count: int) -> range:
    indices = [i for i, row in enumerate(rows) if row.phase is phase]
    middle = indices[len(indices) // 2]
    return range(middle - count // 2, middle - count // 2 + count)


@pytest.mark.parametrize("wild_a", [-10.0, 10.0])
@pytest.mark.parametrize("phase", [Phase.SWING, Phase.STANCE, Phase.EXTRACTION])
def test_one_wild_sample_moves_no_coefficient_out_of_its_interval(phase: Phase, wild_a: float) -> None:
    """One sample at a time is wild, all along the stroke. 10 A is the most that the drives give and five times their
    current here. Each sample is in two loads, half-way to its neighbours, and so in two batches where these meet.
    """
    rows = noisy(rows_of(motion(gait=PROTOCOLS["single_flipper"])), 4)
    calm = one(rows)
    for index in [i for i, row in enumerate(rows) if row.phase is phase][3::89]:
        wild = one([*rows[:index], rows[index].pushed(wild_a, wild_a), *rows[index + 1 :]])
        for a, b in zip(coefficients(calm), coefficients(wild), strict=True):
            assert abs(b.value - a.value) < 1.96 * b.std_error


# noise


@cache
def drawn(seed: int) -> tuple[Mud, StrideEstimate]:
    """Return a stride with random errors of 1 mm in the surface, 3.2 % in each torque constant and noise in the
    currents; the face carries 20 % of the stance's load, and mud clings to the flipper.
    """
    random = np.random.default_rng(seed)
    mud = Mud(surface_m=random.normal(0.0, 0.001), face_fraction=0.2, weight_n=random.uniform(0.3, 1.0))
    constants = WEIGHTLESS[1:3] * (1.0 + random.normal(0.0, 0.032, 2))
    known = WEIGHTLESS._replace(sweep_constant_nm_a=constants[0], adduction_constant_nm_a=constants[1])
    return mud, one(noisy(rows_of(motion(), mud), seed), estimator(known))


def test_the_interval_of_95_percent_covers_the_truth_about_that_often() -> None:
    """A true 95 % would read 90 to 99 % in 49 of 50 such tests; intervals half as wide as they should be would read
    68 %, and of intervals twice as wide the errors would fill a half.
    """
    reported = [drawn(seed) for seed in range(120)]
    for index in range(3):
        pairs = [(coefficients(stride)[index], mud[index]) for mud, stride in reported]
        assert sum(each.valid for each, _ in pairs) >= 119
        hits = [abs(each.value - truth) <= 1.96 * each.std_error for each, truth in pairs if each.valid]
        assert np.mean(hits) >= 0.9
        spread = np.std([(each.value / truth - 1.0) * each.value / each.std_error for each, truth in pairs])
        assert 0.5 <= spread <= 1.1  # k_p's interval includes the error of the law, absent in this mud


def test_no_coefficient_is_biased_by_more_than_half_its_uncertainty() -> None:
    """The bend of the law makes 3 to 5 %, a whole standard error; the surface's nominal height, which is weighed
    against it, and the load on the face, which rises with depth squared, compensate most of it. The mean of 100 strides
    errs by a tenth.
    """
    reported = [drawn(seed) for seed in range(100)]
    scores = [
        [(each.value - truth) / each.std_error for each, truth in zip(coefficients(stride), mud[:3], strict=True)]
        for mud, stride in reported
    ]
    assert np.abs(np.mean(scores, axis=0)).max() < 0.5


# motors at their limit, bodies that move


def test_step_and_position_are_the_bodys() -> None:
    """The step is the advance from close to close; the position is where the insertion ended."""
    rows = [row._replace(body_m=7.0 + 0.05 * row.now_s) for row in rows_of(motion(strides=3))]
    strides = closed(rows)
    first = strides[0]
    assert len(strides) == 3
    assert first.step_m == pytest.approx(0.05 * (first.t_end_s - rows[0].now_s))
    for before, after in pairwise(strides):
        assert after.step_m == pytest.approx(0.05 * (after.t_end_s - before.t_end_s))
    ended_s = [a.now_s for a, b in pairwise(rows) if a.phase is Phase.INSERTION is not b.phase]
    assert [stride.position_m for stride in strides] == pytest.approx([7.0 + 0.05 * now_s for now_s in ended_s])
    lost = closed(row._replace(body_m=nan) if row.now_s == first.t_end_s else row for row in rows)
    assert [isfinite(stride.step_m) for stride in lost] == [False, False, True]


# loads


def test_the_load_is_the_mud_without_what_clings_to_the_flipper() -> None:
    """The tolerance of 10 mN·m is 0.08 N of the zero. The load is that of half a tick before the newest sample, since
    the acceleration is measured between two samples.
    """
    mud, flipper = MUD._replace(weight_n=0.7, friction_nm=0.02), estimator()
    moments = motion()
    for i, row in enumerate(rows_of(moments, mud)[:-1]):
        load, _ = update(flipper, *row)
        if row.phase is Phase.STANCE is moments[i - 1].phase:
            sweep_nm, adduction_nm = mud_torques_nm(moments[i], mud)
            assert load.sweep_torque_nm == pytest.approx(sweep_nm, abs=0.01)
            assert load.adduction_torque_nm == pytest.approx(adduction_nm, abs=0.01 + mud.friction_nm)  # of any sign
            assert load.depth_m == pytest.approx(row.depth_m, abs=1e-4)
            assert not isfinite(load.force_z_n)  # in stance no upward force is reported


def test_the_largest_forces_of_the_stride_are_reported() -> None:
    """The tolerance of 3 % covers the level that the insertion leaves for the zero and half a tick of the quick
    extraction.
    """
    stride, forces = one(rows_of(motion())), dict[Phase, list[tuple[float, float]]]()
    for moment in motion():
        torques_nm = mud_torques_nm(moment, MUD)
        force_n = smallest_force_n(GEOMETRY, moment.sweep_rad, moment.adduction_rad, *torques_nm)
        forces.setdefault(moment.phase, []).append(force_n)
    assert stride.insertion_force_n == pytest.approx(max(z for _, z in forces[Phase.INSERTION]), rel=0.03)
    assert stride.stance_force_n == pytest.approx(max(x for x, _ in forces[Phase.STANCE]), rel=0.03)
    assert stride.extraction_force_n == pytest.approx(min(z for _, z in forces[Phase.EXTRACTION]), rel=0.03)


# what closes a stride


@pytest.mark.parametrize("phase", [Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION])
def test_a_stride_cut_short_does_not_close_and_is_not_counted(phase: Phase) -> None:
    rows, flipper = rows_of(motion()), estimator()
    middle = _middle(rows, phase, 0).start
    assert closed([*rows[:middle], rows[middle]._replace(phase=Phase.REST)], flipper) == []
    stride = one((row._replace(now_s=row.now_s + 60.0) for row in rows), flipper)
    assert stride.index == 0
    assert ratios(stride, MUD) == pytest.approx(ratios(one(rows), MUD), rel=0.01)  # both share the zero and the surface


def test_a_flipper_that_meets_no_mud_gives_a_reason() -> None:
    stride = one(noisy(rows_of(motion(-0.001)), 1, 0.05))
    assert not any(each.valid for each in coefficients(stride))
    assert all(each.reason for each in coefficients(stride))
    assert stride.surface_m == pytest.approx(0.0, abs=1e-3)
    assert stride.released


def lifted_to(highest_m: float) -> list[Moment]:
    """Return a motion whose extraction ends below `highest_m`, as in mud that holds the flipper."""
    moments = []
    for moment in motion():
        depth_m = moment.depth_m
        if moment.phase is Phase.EXTRACTION and depth_m < highest_m:
            moment = moment._replace(adduction_rad=GEOMETRY.adduction_rad(moment.sweep_rad, highest_m))
        moments.append(moment)
    return moments


def edge_depth_m(lowest_depth_m: float) -> float:
    """Return the depth of the edge's middle, at the rear, for that depth of the plate's lowest corner."""
    rear_rad, edge_m = radians(-GAIT.sweep_angle_deg), lowest_depth_m
    for _ in range(20):
        edge_m += lowest_depth_m - lowest_point_m(GEOMETRY, rear_rad, GEOMETRY.adduction_rad(rear_rad, edge_m))
    return edge_m


@pytest.mark.parametrize("surface_m", [-0.003, 0.003])
@pytest.mark.parametrize(("below_m", "released"), [(-1e-4, True), (1e-4, False)])
def test_released_follows_the_gaits_condition_at_any_height_of_the_mud(
    below_m: float, released: bool, surface_m: float
) -> None:
    moments = lifted_to(edge_depth_m(OUT_M + below_m))
    *_, last = (moment for moment in moments if moment.phase is Phase.EXTRACTION)
    assert is_in_mud(GEOMETRY, last.sweep_rad, last.adduction_rad) is not released
    assert one(waiting(rows_of(moments, MUD._replace(surface_m=surface_m)))).released is released


def with_recovery(rows: Sequence[Row], weight_a: float) -> list[Row]:
    """Insert a second before the swing in which another current pulls the flipper up."""
    swing = max(i for i, row in enumerate(rows) if row.phase is Phase.SWING)
    held, ticks = rows[swing - 1], round(RATE_HZ)
    freed = [
        later(held, tick / RATE_HZ, held.adduction.angle_rad * (1.0 - tick / ticks)).pushed(0.0, weight_a)
        for tick in range(1, ticks + 1)
    ]
    return [*rows[:swing], *freed, *(later(row, 1.0, row.adduction.angle_rad) for row in rows[swing:])]


def later(row: Row, seconds: float, adduction_rad: float) -> Row:
    shifted = row.later(seconds)
    phase = row.phase if row.phase is Phase.SWING else Phase.RECOVERY
    return shifted._replace(phase=phase, adduction=shifted.adduction._replace(angle_rad=adduction_rad))


def test_a_stride_with_a_recovery_closes_with_the_swing_and_was_not_released() -> None:
    rows = rows_of(lifted_to(0.02))
    stride, longer = one(waiting(rows)), one(with_recovery(rows, 2.0))
    assert not longer.released
    assert longer.t_end_s == pytest.approx(rows[-1].now_s + 1.0)
    assert coefficients(longer) == coefficients(stride)
    assert longer.extraction_s == pytest.approx(stride.extraction_s)


def test_a_recovery_does_not_shift_the_zero() -> None:
    """The recovery ends 14 mm above the mud with 2 A in excess; the next stride's zero is that of the swing alone."""
    first = rows_of(motion(strides=2), MUD, HEAVY)
    border = next(i for i, (a, b) in enumerate(pairwise(first), 1) if a.phase is Phase.EXTRACTION is not b.phase)
    whole = with_recovery(first[: border + 1], 2.0)
    rest = [later(row, 1.0, row.adduction.angle_rad)._replace(phase=row.phase) for row in first[border + 1 :]]
    plain, second = closed(first, estimator(HEAVY))[1], closed([*whole, *rest], estimator(HEAVY))[1]
    assert second.tare_n == pytest.approx(plain.tare_n, abs=1e-3)


# memory


def test_a_reset_forgets_stride_zero_and_count() -> None:
    rows, flipper = rows_of(motion(strides=2), MUD, HEAVY), estimator(HEAVY)
    closed((row.pushed(0.5, 0.5) for row in rows[: len(rows) * 2 // 3]), flipper)
    flipper.reset()
    assert repr(closed(rows, flipper)) == repr(closed(rows, estimator(HEAVY)))
