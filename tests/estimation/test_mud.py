"""Both flippers together: the samples that each one gets, and what is remembered between strides.

The strokes are synthetic, through mud that keeps the estimator's own laws. One flipper's estimates have their own
tests; here each flipper must give what it would give alone.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import inf, nan
from typing import Any

import pytest

from control.mud_estimate import NOTHING_KNOWN
from control.records import FLIPPERS, BodyPose, Joints, Phase, StrideEstimate
from estimation.estimation_parameters import EstimationParameters, Method, PaperEstimationParameters
from estimation.flipper import FlipperEstimator
from estimation.joint_load import FlipperDrive
from estimation.mud import PAPER_DRAG_N, MudEstimator, MudReading
from estimation.mud_map import PIECE_M
from estimation.paper import PaperEstimator
from estimation.recorded_states import recorded_states
from estimation.strokes.fit_samples import NO_FITS
from estimation.strokes.shear import Base
from tests.estimation.synthetic_strides import DRIVE, GEOMETRY, K_P, WEIGHTLESS, Row, stride_samples
from tests.estimation.synthetic_strides import update as update_one

STRIDES, PERIOD_OF_STRIDE_S = 3, 2.0


def walk(seed: int) -> list[Row]:
    """Return a walk whose last row, with which a swing begins, closes the last stride."""
    once = stride_samples(seed)
    return [row.later(PERIOD_OF_STRIDE_S * stride) for stride in range(STRIDES) for row in once]


def estimator(method: Method = "default") -> MudEstimator:
    return MudEstimator(GEOMETRY, (DRIVE, DRIVE), EstimationParameters(method=method, fixed_base=True))


def update(mud: MudEstimator, left: Row, right: Row, body_x_m: float = 0.0) -> MudReading:
    states = Joints(left.sweep, left.adduction, right.sweep, right.adduction)
    return mud.update(left.now_s, left.phase, states, BodyPose(left.now_s, body_x_m))


def strides_of(
    mud: MudEstimator, left: Sequence[Row], right: Sequence[Row], speed_m_s: float = 0.0
) -> list[StrideEstimate]:
    readings = [update(mud, a, b, speed_m_s * a.now_s) for a, b in zip(left, right, strict=True)]
    return [stride for reading in readings for stride in reading.strides]


# both flippers


def flipper_estimator(flipper: str, method: Method) -> FlipperEstimator | PaperEstimator:
    if method == "paper":
        return PaperEstimator(flipper, GEOMETRY, DRIVE)
    return FlipperEstimator(flipper, GEOMETRY, DRIVE, Base.FIXED, PAPER_DRAG_N)


@pytest.mark.parametrize("method", ["default", "paper"])
def test_each_flipper_gets_the_samples_that_it_would_get_alone(method: Method) -> None:
    left, right, mud = walk(1), walk(2), estimator(method)
    alone = {flipper: flipper_estimator(flipper, method) for flipper in FLIPPERS}
    times_s = [nan, nan, *(sample.now_s for sample in left)]  # a sample answers the commands of the two before it
    for a, b, earlier_s, later_s in zip(left, right, times_s, times_s[1:], strict=False):
        reading = update(mud, a, b)
        reported = [
            update_one(alone[flipper], *row, (earlier_s, later_s)) for flipper, row in (("left", a), ("right", b))
        ]
        assert repr(reading.loads) == repr((reported[0][0], reported[1][0]))
        assert repr(reading.strides) == repr(tuple(stride for _, stride in reported if stride is not None))


@pytest.mark.parametrize("late", FLIPPERS)
def test_a_flipper_that_leaves_the_mud_late_is_waited_for(late: str) -> None:
    """Its extraction ends in the mud: the other flipper's stride closes together with it, and the left one comes
    first.
    """
    swings = [i for i, (a, b) in enumerate(pairwise(walk(1)), 1) if a.phase is Phase.EXTRACTION is not b.phase]
    rows = {flipper: walk(seed) for seed, flipper in enumerate(FLIPPERS, 1)}
    for i in swings[:-1]:
        deep = rows[late][i - 1].adduction._replace(angle_rad=GEOMETRY.adduction_rad(0.5, 0.02))
        rows[late][i - 1] = rows[late][i - 1]._replace(adduction=deep)
    mud = estimator()
    readings = [update(mud, a, b).strides for a, b in zip(rows["left"], rows["right"], strict=True)]
    closed = [[(stride.flipper, stride.index) for stride in strides] for strides in readings if strides]
    assert closed == [[("left", index), ("right", index)] for index in range(STRIDES)]
    assert not readings[swings[0]]


def test_a_silent_flipper_does_not_disturb_the_other_one() -> None:
    left = walk(1)
    silent = [sample._replace(sweep=sample.sweep._replace(angle_rad=nan)) for sample in walk(2)]
    both, alone = strides_of(estimator(), left, walk(2)), strides_of(estimator(), left, silent)
    assert repr([each for each in alone if each.flipper == "left"]) == repr(
        [each for each in both if each.flipper == "left"]
    )
    assert not any(each.k_p.valid for each in alone if each.flipper == "right")


@pytest.mark.parametrize("method", ["default", "paper"])
def test_each_joint_has_its_own_torque_constant(method: Method) -> None:
    drives = (FlipperDrive(WEIGHTLESS, 0.05, 0.06), FlipperDrive(WEIGHTLESS, 0.07, 0.08))
    mud = MudEstimator(GEOMETRY, drives, EstimationParameters(method=method))
    states = recorded_states(0.0, (0.0,) * 4, (0.0,) * 4, (1.0, 2.0, 3.0, 4.0))
    reading = mud.update(0.0, Phase.REST, states, BodyPose(0.0, 0.0))
    torques = [getattr(load, name) for load in reading.loads for name in ("sweep_torque_nm", "adduction_torque_nm")]
    assert torques == pytest.approx([-0.05, -0.12, -0.21, -0.32])


# the configured method


def test_the_paper_adds_the_drag_only_if_configured() -> None:
    parameters = EstimationParameters(method="paper", paper=PaperEstimationParameters(compensation=True))
    left = MudEstimator(GEOMETRY, (DRIVE, DRIVE), parameters, 7.0).flippers[0]
    assert isinstance(left, PaperEstimator)
    assert left.drag_n == 3.5


@pytest.mark.parametrize(
    ("configured", "mass_kg", "base", "lift_n"),
    [
        ({"fixed_base": True}, 1.0, Base.FIXED, inf),
        ({"free_body": True}, 1.0, Base.FREE, 2.45),  # half of its weight
        ({"free_body": True}, 0.0, Base.FREE, 0.0),  # of an unknown mass: any force
    ],
)
def test_the_default_gets_base_drag_surface_error_and_what_lifts_a_free_body(
    configured: dict[str, Any], mass_kg: float, base: Base, lift_n: float
) -> None:
    parameters = EstimationParameters(surface_error_m=0.004, **configured)
    mud = MudEstimator(GEOMETRY, (DRIVE, DRIVE), parameters, 7.0, body_mass_kg=mass_kg)
    for flipper, name in zip(mud.flippers, FLIPPERS, strict=True):
        assert isinstance(flipper, FlipperEstimator)
        assert (flipper.flipper, flipper.base) == (name, base)
        assert (flipper.drag_n, flipper.surface_error_m) == (3.5, 0.004)
        assert flipper.lift_n == pytest.approx(lift_n, rel=0.01)


# what is known from stride to stride


def test_estimate_is_that_of_the_strides_so_far() -> None:
    mud = estimator()
    for a, b in zip(walk(1), walk(2), strict=True):
        before, reading = mud.mud_estimate, update(mud, a, b)
        if not reading.strides:
            assert mud.mud_estimate is before
    for flipper in (mud.mud_estimate.left, mud.mud_estimate.right):
        assert flipper.k_p is not None and flipper.k_s is not None and flipper.k_e is not None
        assert flipper.k_p.strides == STRIDES
    assert mud.mud_estimate.k_p is not None
    assert mud.mud_estimate.k_p.value == pytest.approx(K_P, rel=0.1)  # 3 to 5 % by the surface, see test_flipper


def test_the_map_contains_both_flippers_strides_at_the_body_position() -> None:
    """The body moves at 0.1 m/s with a stride every 2 s: 20 cm from close to close, which are four pieces."""
    mud = estimator()
    strides = strides_of(mud, walk(1), walk(2), speed_m_s=0.1)
    rows = mud.map.rows()
    assert len(rows) == STRIDES
    closed_m = [0.1 * stride.t_end_s for stride in strides if stride.flipper == "left"]
    assert [row.position_m for row in rows] == pytest.approx(closed_m, abs=PIECE_M / 2.0)
    assert [row.k_p.strides for row in rows if row.k_p is not None] == [2] * STRIDES


@pytest.mark.parametrize("method", ["default", "paper"])
def test_a_reset_forgets_strides_estimate_and_map(method: Method) -> None:
    mud = estimator(method)
    first = strides_of(mud, walk(1), walk(2), speed_m_s=0.1)
    mud_estimate, rows = mud.mud_estimate, mud.map.rows()
    assert mud_estimate != NOTHING_KNOWN and rows
    mud.reset()
    assert mud.mud_estimate == NOTHING_KNOWN
    assert not mud.map.rows() and not mud.felt_strides
    assert mud.fits_of("left") == NO_FITS
    assert repr(strides_of(mud, walk(1), walk(2), speed_m_s=0.1)) == repr(first)
    assert (mud.mud_estimate, mud.map.rows()) == (mud_estimate, rows)
