"""The mud along the track, against numpy's weighted means piece by piece."""

from math import exp, inf, log, nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from control.records import StrideEstimate
from estimation.mud_map import MOST_PIECES, PIECE_M, Mapped, MudMap
from estimation.strokes.depth_line import REPEATABILITY
from tests.control.synthetic_muds import measured as reported
from tests.control.synthetic_muds import stride


def mapped(*strides: StrideEstimate, position_m: float = 0.01) -> MudMap:
    mud_map = MudMap()
    for each in strides:
        mud_map.update(position_m, [each])
    return mud_map


def only(mud_map: MudMap) -> Mapped:
    """Return k_s of the only piece."""
    (row,) = mud_map.rows()
    assert row.k_s is not None
    return row.k_s


# Values this close never differ by more than their errors explain, which would widen the standard error.
@given(st.lists(st.tuples(st.floats(0.95, 1.05), st.floats(0.1, 0.5), st.floats(0.02, 0.05)), min_size=1, max_size=30))
def test_a_piece_has_the_weighted_mean_of_its_strides(rows: list[tuple[float, float, float]]) -> None:
    piece = only(mapped(*(stride(k_s=reported(1e6 * value, relative), depth_m=z) for value, relative, z in rows)))
    weights = np.array([1.0 / (relative**2 + REPEATABILITY**2) for _, relative, _ in rows])
    assert piece.value == pytest.approx(1e6 * exp(np.average([log(value) for value, _, _ in rows], weights=weights)))
    assert piece.depth_m == pytest.approx(exp(np.average([log(z) for _, _, z in rows], weights=weights)))
    assert piece.std_error / piece.value == pytest.approx(1.0 / sqrt(float(np.sum(weights))))
    assert (piece.strides, piece.at_least) == (len(rows), False)


@pytest.mark.parametrize("factors", [(0.5, 1.9), (0.5, 0.6, 1.5, 1.9)])
def test_strides_that_differ_by_more_than_their_errors_widen_it_by_their_scatter(factors: tuple[float, ...]) -> None:
    piece = only(mapped(*(stride(k_s=reported(1e6 * factor)) for factor in factors)))
    scatter = float(np.std(np.log(factors), ddof=1)) / sqrt(len(factors))
    assert piece.std_error / piece.value == pytest.approx(scatter)
    assert scatter > 3.0 * REPEATABILITY / 2.0


def test_pieces_are_five_centimetres_long_and_known_in_the_order_of_positions() -> None:
    mud_map = MudMap()
    for position_m in (0.12, -0.01, 0.04, 0.06, 0.001, 0.0999):
        mud_map.update(position_m, [stride(k_s=reported(1e6))])
    rows = mud_map.rows()
    assert [row.position_m for row in rows] == pytest.approx([-0.025, 0.025, 0.075, 0.125])
    assert [row.k_s.strides for row in rows if row.k_s] == [1, 2, 2, 1]


@pytest.mark.parametrize("position_m", [nan, inf, -inf, 1.7e308])
def test_a_stride_without_a_position_is_on_no_map(position_m: float) -> None:
    assert mapped(stride(k_s=reported(1e6)), position_m=position_m).rows() == ()


def test_a_stride_that_gives_no_estimate_leaves_no_trace() -> None:
    known = stride(k_s=reported(1e6))
    assert mapped(stride()).rows() == ()
    assert mapped(known, stride()).rows() == mapped(known).rows()


def test_a_bound_stands_only_until_a_value_comes() -> None:
    low, high = stride(k_s=reported(1e6, at_least=True)), stride(k_s=reported(1.5e6, at_least=True))
    for strides in ((low, high), (high, low)):
        piece = only(mapped(*strides))
        assert piece.at_least
        assert piece.value == pytest.approx(1.5e6)
    value = stride(k_s=reported(1.2e6))
    for order in ((low, high, value), (low, value, high), (value, low, high)):
        piece = only(mapped(*order))
        assert (piece.strides, piece.at_least) == (1, False)
        assert piece.value == pytest.approx(1.2e6)


def test_a_long_walk_drops_the_pieces_that_were_visited_longest_ago() -> None:
    mud_map = MudMap()
    for number in range(MOST_PIECES):
        mud_map.update((number + 0.5) * PIECE_M, [stride(k_s=reported(1e6))])
    mud_map.update(0.5 * PIECE_M, [stride(k_s=reported(1e6))])  # back at the first one
    for number in range(MOST_PIECES, MOST_PIECES + 3):
        mud_map.update((number + 0.5) * PIECE_M, [stride(k_s=reported(1e6))])
    pieces = [round(row.position_m / PIECE_M - 0.5) for row in mud_map.rows()]
    assert pieces == [0, *range(4, MOST_PIECES + 3)]
