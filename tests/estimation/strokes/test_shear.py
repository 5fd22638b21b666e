"""Stances of synthetic batches: whether the mud or the body moved, and what that says about the mud's strength.

A flipper sweeps back from 30 to -30 degrees at 3 cm in pieces of 6 mm, like the estimator's batches. The mud resists
with k_s Ψ once it has been sheared far enough and with less before, as real mud does; the body stands, or advances by a
fraction of the flipper's travel.
"""

from collections.abc import Sequence
from math import cos, hypot, isnan, nan, radians, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.computing.bounded_work import finish
from control.geometry import FlipperGeometry
from control.plate_integrals import stance_moment_m4, submerged_plate
from estimation.strokes.origin_fit import MIN_BATCHES, fit_through_origin
from estimation.strokes.shear import (
    HELD,
    MOBILISED_M,
    QUICK_UNCERTAINTY,
    SLIPPING,
    Base,
    Shear,
    find_shear,
    shear_samples,
    sheared_stroke,
    slips_m,
    yield_force_n,
)
from estimation.strokes.stroke import Batch
from estimation.strokes.stroke_fit import TORQUE_REPEATABILITY

GEOMETRY = FlipperGeometry()
LENGTH_M, FRONT_RAD, STEP_RAD = 0.12, radians(30.0), 0.05
DEPTH_M, K_S, DRAG_N = 0.03, 0.6e6, 1.25
COUNT = 21
EXACT = 1e-9  # rounding


def moment_m4(batch: Batch, surface_m: float = 0.0) -> float:
    plate = submerged_plate(GEOMETRY, batch.sweep_rad, batch.adduction_rad, surface_m)
    return stance_moment_m4(GEOMETRY, plate)


def poses(body_fraction: float = 0.0, depth_m: float = DEPTH_M, count: int = COUNT) -> list[Batch]:
    """Return batches without load. The body advances by `body_fraction` of the flipper's travel."""
    batches, front_m = [], LENGTH_M * sin(FRONT_RAD)
    for i in range(count):
        sweep_rad = FRONT_RAD - STEP_RAD * i
        adduction_rad = GEOMETRY.adduction_rad(sweep_rad, depth_m)
        body_m = body_fraction * (front_m - LENGTH_M * sin(sweep_rad))
        batches.append(Batch(LENGTH_M * sweep_rad, sweep_rad, adduction_rad, 0.0, 0.0, body_m, False, 10, 0.5))
    return batches


def pressed(batches: Sequence[Batch], k_s: float = K_S, surface_m: float = 0.0) -> list[Batch]:
    """Load every batch with the full strength of the mud."""
    return [batch._replace(sweep_nm=k_s * moment_m4(batch, surface_m)) for batch in batches]


def sheared(batches: Sequence[Batch], base: Base = Base.FREE) -> list[Batch]:
    """Load the batches with a strength that grows with the slip, up to the full strength at MOBILISED_M."""
    path_m, loaded = 0.0, []
    for batch, slip_m in zip(batches, [0.0, *(slips_m(GEOMETRY, batches, base) or ())], strict=True):
        path_m += slip_m
        loaded.append(batch._replace(sweep_nm=min(path_m / MOBILISED_M, 1.0) * K_S * moment_m4(batch)))
    return loaded


def without_pose(batches: Sequence[Batch]) -> list[Batch]:
    return [batch._replace(body_m=nan) for batch in batches]


def shaken(batches: Sequence[Batch], fraction: float) -> list[Batch]:
    """Let the torques alternate by a fraction to either side."""
    return [b._replace(sweep_nm=b.sweep_nm * (1.0 + (fraction if i % 2 else -fraction))) for i, b in enumerate(batches)]


def found(batches: Sequence[Batch], base: Base = Base.FREE, drag_n: float = DRAG_N, surface_m: float = 0.0) -> Shear:
    return finish(find_shear(GEOMETRY, batches, surface_m, base, drag_n))


def k_of(shear: Shear) -> float:
    assert shear.fit is not None
    return shear.fit.slope


def withstood(batches: Sequence[Batch]) -> list[float]:
    return [batch.sweep_nm / moment_m4(batch) for batch in batches]


# the body stands


@pytest.mark.parametrize("surface_m", [-0.003, 0.0, 0.003])
@pytest.mark.parametrize("k_s", [0.05e6, 0.6e6, 5.0e6])
@pytest.mark.parametrize("base", [Base.FREE, Base.FIXED])
def test_a_body_at_rest_gives_the_strength_of_the_mud(base: Base, k_s: float, surface_m: float) -> None:
    shear = found(pressed(poses(), k_s, surface_m), base, surface_m=surface_m)
    assert (shear.case, shear.at_least, shear.reason) == ("yield", False, "")
    assert k_of(shear) == pytest.approx(k_s, rel=EXACT)


@pytest.mark.parametrize("base", [Base.FREE, Base.FIXED])
def test_the_strength_is_fitted_to_the_pieces_that_had_been_sheared_far_enough(base: Base) -> None:
    """The fit takes exactly those pieces, whose torques alternate by ±2 %."""
    even = sheared(poses(), base=base)
    assert withstood(even)[2] < 0.6 * K_S  # so that the test would notice the load before the mud was mobilised
    full = [fraction > (1.0 - EXACT) * K_S for fraction in withstood(even)]
    uneven = shaken(even, 0.02)
    reported = [b for b, is_full in zip(uneven, full, strict=True) if is_full]
    shear = found(uneven, base)
    assert shear.fit == fit_through_origin([moment_m4(b) for b in reported], [b.sweep_nm for b in reported])
    assert shear.samples == 10 * len(reported)


def test_the_samples_of_a_mirrored_stance_are_where_the_plate_was() -> None:
    batches = sheared(poses())
    forward, mirrored = (shear_samples(GEOMETRY, batches, 0.0, found(batches), mirrored=each) for each in (False, True))
    assert forward and mirrored
    assert forward.sweeps_rad == [batches[i].sweep_rad for i in found(batches).steady]
    assert mirrored == forward._replace(sweeps_rad=[-each for each in forward.sweeps_rad])
    assert forward.depths_m == pytest.approx([DEPTH_M] * len(forward.depths_m))


def in_sand(rises_m: Sequence[float]) -> list[Batch]:
    """Return batches of a path that rises by so much to each next piece, in sand, which resists along the motion."""
    level = poses(count=1 + len(rises_m))
    depth_m, path = DEPTH_M, level[:1]
    for batch, rise_m in zip(level[1:], rises_m, strict=True):
        depth_m -= rise_m
        path.append(batch._replace(adduction_rad=GEOMETRY.adduction_rad(batch.sweep_rad, depth_m)))
    slips = [0.0, *(slips_m(GEOMETRY, path, Base.FIXED) or ())]
    cosines = [slip_m / hypot(slip_m, rise_m) for slip_m, rise_m in zip(slips[1:], rises_m, strict=True)]
    return [
        batch._replace(sweep_nm=cosine * K_S * moment_m4(batch))
        for batch, cosine in zip(path, [1.0, *cosines], strict=True)
    ]


def found_on_path(batches: Sequence[Batch]) -> Shear:
    return finish(find_shear(GEOMETRY, batches, 0.0, Base.FIXED, DRAG_N, along_path=True))


def test_pieces_of_a_path_that_rise_more_than_they_slip_do_not_count() -> None:
    level, rising = [0.0] * 9, [0.0065] * 4
    shear = found_on_path(in_sand(level + rising))
    assert shear == found_on_path(in_sand(level)) != found(in_sand(level + rising), Base.FIXED)
    assert k_of(shear) == pytest.approx(K_S, rel=EXACT)
    assert shear.oblique == pytest.approx(0.0, abs=EXACT)


@pytest.mark.parametrize("rise_m", [-0.0008, 0.0008])
def test_what_sand_takes_away_from_a_path_that_rises_or_sinks_is_an_uncertainty(rise_m: float) -> None:
    shear = found_on_path(in_sand([rise_m] * (COUNT - 1)))
    assert 0.005 < shear.oblique < 0.02
    assert k_of(shear) == pytest.approx((1.0 - shear.oblique) * K_S, rel=0.001)


# the body moves


def stuck(count: int) -> list[Batch]:
    return [batch._replace(saturated=i >= count - 2) for i, batch in enumerate(pressed(poses(count=count)))]


def creeping(samples: int) -> list[Batch]:
    """Return a stance of 21 batches, of which two with these samples are clipped."""
    return [b._replace(saturated=True, samples=samples) if i in (8, 9) else b for i, b in enumerate(pressed(poses()))]


BODY, MOTOR, NO_POSE = "the mud held: the body moved", "a motor at its limit", "no pose: the body may have moved"


@pytest.mark.parametrize(
    ("batches", "base", "case", "k_s", "reason"),
    [
        # the mud only has to withstand the body's drag, a third of its strength
        (pressed(poses(0.95), K_S / 3.0), Base.FREE, "limited_by_body", K_S / 3.0, BODY),
        (pressed(poses(0.9)), Base.FIXED, "yield", K_S, ""),  # a fixed base ignores the pose
        # a plate that hardly slips is held; over a long path it would slip MOBILISED_M all the same
        (pressed(poses(1.0 - 0.9 * SLIPPING)), Base.FREE, "limited_by_body", K_S, BODY),
        # at 70 % of 12 cm the plate slips 3.6 cm: few batches are left, but each has the full strength
        *((sheared(poses(fraction)), Base.FREE, "mixed", K_S, "") for fraction in (0.25, 0.5, 0.7)),
        *((stuck(6), base, "limited_by_motor", K_S, MOTOR) for base in (Base.FREE, Base.FIXED)),
        (stuck(COUNT), Base.FREE, "yield", K_S, ""),  # it shears the mud all the same
        # 38 samples in each are 28.6 % of the stance, 42 are 30.7 %: a plate that creeps does not yield
        *((creeping(38), base, "yield", K_S, "") for base in (Base.FREE, Base.FIXED)),
        *((creeping(42), base, "limited_by_motor", K_S, MOTOR) for base in (Base.FREE, Base.FIXED)),
        (without_pose(pressed(poses())), Base.FREE, "unknown", K_S, NO_POSE),
    ],
)
def test_the_strength_is_a_value_where_the_plate_slips_and_a_bound_where_body_or_motor_gives_way(
    batches: list[Batch], base: Base, case: str, k_s: float, reason: str
) -> None:
    shear = found(batches, base)
    assert (shear.case, shear.at_least, shear.reason) == (case, bool(reason), reason)
    assert k_of(shear) == pytest.approx(k_s, rel=EXACT)
    assert not reason or shear.samples == sum(batch.samples for batch in batches)


def test_only_the_pieces_count_in_which_the_plate_slips() -> None:
    """The body stands for half of the stance and is then pushed along with half of the force."""
    still, moved = pressed(poses(0.0)), pressed(poses(1.0), K_S / 2.0)
    middle = COUNT // 2
    start_m = moved[middle].body_m
    batches = [*still[:middle], *(batch._replace(body_m=batch.body_m - start_m) for batch in moved[middle:])]
    shear = found(batches)
    assert shear.case == "mixed"
    assert k_of(shear) == pytest.approx(K_S, rel=0.02)  # the batch in between has half of each


@pytest.mark.parametrize("advance", [0.0, 0.3, 0.6])
def test_the_strength_has_the_speed_of_the_plate_in_the_mud(advance: float) -> None:
    batches = [batch._replace(speed_m_s=0.5) for batch in sheared(poses(advance))]
    stroke = sheared_stroke(GEOMETRY, batches, 0.0, found(batches))
    assert stroke.speed_m_s == pytest.approx(0.5 * (1.0 - advance))


def test_the_slip_is_the_path_back_through_the_mud() -> None:
    batches = poses(0.4)
    reported = slips_m(GEOMETRY, batches, Base.FREE)
    assert reported is not None
    path_m = LENGTH_M * (sin(batches[0].sweep_rad) - sin(batches[-1].sweep_rad))
    assert sum(reported) == pytest.approx(0.6 * path_m)
    assert sum(slips_m(GEOMETRY, batches, Base.FIXED) or ()) == pytest.approx(path_m)
    assert slips_m(GEOMETRY, without_pose(batches), Base.FREE) is None


# a motor at its limit


@pytest.mark.parametrize("depth_m", [0.02, 0.05])
def test_the_yield_force_needs_no_surface_and_no_depth(depth_m: float) -> None:
    batches = [batch._replace(sweep_nm=0.48) for batch in pressed(poses(depth_m=depth_m))]
    for surface_m in (-0.004, 0.0, 0.004):
        shear = found(batches, Base.FIXED, surface_m=surface_m)
        force_n, error_n = yield_force_n(GEOMETRY, batches, shear, 0.01)
        assert force_n == pytest.approx(0.48 / LENGTH_M)
        assert error_n == pytest.approx(hypot(0.01, TORQUE_REPEATABILITY * 0.48) / LENGTH_M)


def test_a_bound_has_no_yield_force() -> None:
    batches = stuck(6)
    assert all(map(isnan, yield_force_n(GEOMETRY, batches, found(batches), 0.01)))


@pytest.mark.parametrize("count", range(1, HELD[0]))
def test_fewer_than_three_batches_give_no_estimate(count: int) -> None:
    shear = found(stuck(count))
    assert shear.fit is None
    assert shear.reason == "a motor at its limit"


def test_a_bound_becomes_a_value_once_a_fit_has_enough_pieces() -> None:
    """As the stance gets longer, a bound becomes a value when MIN_BATCHES have yielded."""
    cases = [found(pressed(poses(count=count))).case for count in range(3, COUNT + 1)]
    first = cases.index("yield")
    assert set(cases[:first]) == {"limited_by_body"} and set(cases[first:]) == {"yield"}
    path_m = LENGTH_M * (sin(FRONT_RAD) - sin(FRONT_RAD - STEP_RAD * (first + 2)))
    assert path_m == pytest.approx(MOBILISED_M + (MIN_BATCHES - 1) * 0.006, abs=0.006)  # to one piece


# without a pose


@pytest.mark.parametrize(("fraction", "case"), [(0.79, "yield"), (0.81, "unknown")])
def test_the_body_stands_up_to_four_fifths_of_its_drag(fraction: float, case: str) -> None:
    batches = [batch._replace(sweep_nm=fraction * DRAG_N * LENGTH_M / cos(batch.sweep_rad)) for batch in poses()]
    assert found(without_pose(batches)).case == case


def test_two_wild_pieces_do_not_move_the_body() -> None:
    weak = without_pose(pressed(poses(), 0.05e6))
    for index in (3, 12):
        weak[index] = weak[index]._replace(sweep_nm=5.0)
    assert found(weak).case == "yield"


def test_without_a_pose_a_short_stance_gives_no_value() -> None:
    """However small the force is, such a short path mobilises no mud."""
    assert found(without_pose(pressed(poses(count=5), 1e3))).at_least


def at_rate(batches: Sequence[Batch], held: int) -> list[Batch]:
    """Hold each position of the body for so many batches."""
    return [batch._replace(body_m=batches[i - i % held].body_m) for i, batch in enumerate(batches)]


def test_a_pose_that_comes_too_rarely_makes_no_value_of_a_bound() -> None:
    """A body that hardly advances, and whose encoder has coarse counts, is held too, but never catches up."""
    firm, soft = pressed(poses(0.95), K_S / 3.0), pressed(poses(0.1))
    for held in (3, 4, 5):
        shear = found(at_rate(firm, held))
        assert (shear.at_least, shear.reason) == (True, "the pose comes too rarely: the body may have moved")
        assert found(at_rate(soft, held)).case == "yield"


# bounds


loads_nm = st.lists(st.floats(0.0, 2.0), min_size=3, max_size=COUNT)


@given(loads_nm)
def test_a_bound_never_exceeds_the_load_of_two_batches(torques_nm: list[float]) -> None:
    """The body advances all the way. One outlier cannot make a bound, which is a median of at least three batches."""
    batches = [batch._replace(sweep_nm=torque_nm) for batch, torque_nm in zip(poses(1.0), torques_nm, strict=False)]
    shear = found(batches)
    assert shear.case == "limited_by_body"
    assert k_of(shear) <= sorted(withstood(batches))[-2]


def test_the_bound_is_the_largest_sustained_load() -> None:
    """The batches withstand half of the strength, then all of it, then half again."""
    fractions = [0.5] * 7 + [1.0] * 7 + [0.5] * 7
    batches = [
        b._replace(sweep_nm=fraction * b.sweep_nm) for b, fraction in zip(pressed(poses(1.0)), fractions, strict=True)
    ]
    assert k_of(found(batches)) == pytest.approx(K_S, rel=EXACT)


def test_an_uneven_load_makes_a_bound_more_uncertain() -> None:
    even = pressed(poses(1.0))
    fits = [found(batches).fit for batches in (even, shaken(even, 0.2))]
    uncertainties = [fit.std_error / fit.slope for fit in fits if fit is not None]
    assert uncertainties[0] == pytest.approx(QUICK_UNCERTAINTY)
    assert uncertainties[1] > 1.5 * uncertainties[0]


# no mud, nonsense


@pytest.mark.parametrize("base", [Base.FREE, Base.FIXED])
def test_a_plate_in_the_air_gives_no_estimate(base: Base) -> None:
    shear = found(poses(depth_m=-0.005), base)
    assert shear == Shear(None, False, "unknown", 0, "no depth in any batch")
    assert found([], base).fit is None


@pytest.mark.parametrize("body_fraction", [0.0, 1.0, nan])
def test_a_flipper_that_hardly_sweeps_says_nothing_of_the_body(body_fraction: float) -> None:
    shear = found(pressed(poses(body_fraction, count=2)))
    assert (shear.fit, shear.case, shear.reason) == (None, "unknown", "the sweep in the mud is too short")


@given(st.lists(st.floats(), min_size=COUNT, max_size=COUNT), st.floats(0.0, 1.0), st.floats(), st.floats())
def test_no_torque_makes_it_raise(
    torques_nm: list[float], body_fraction: float, drag_n: float, surface_m: float
) -> None:
    batches = [batch._replace(sweep_nm=each) for batch, each in zip(poses(body_fraction), torques_nm, strict=True)]
    for base in Base:
        for seen in (batches, without_pose(batches)):
            found(seen, base, drag_n, surface_m)
