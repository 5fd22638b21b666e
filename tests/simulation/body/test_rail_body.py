"""The body on its rail without flippers: dry contacts hold it, and it reports its motion."""

import pytest

from simulation.body.rail_body import DRAG_STIFFNESS_N_M, DragPad, DryDrag
from simulation.mud.clay import MUDS

DT_S = 0.0001


def test_a_dry_contact_is_a_spring_until_it_yields_and_remembers_how_far() -> None:
    drag = DryDrag()
    for _ in range(10):
        held_n = drag.step(DT_S, 0.01, 5.0)
    assert held_n == pytest.approx(-DRAG_STIFFNESS_N_M * 1e-5 - 0.71)  # 10 um of spring, and damping of 71 N s/m
    for _ in range(1000):
        assert drag.step(DT_S, 0.1, 5.0) >= -5.0
    yielded_n = [drag.step(DT_S, 0.0, largest_n) for largest_n in (5.0, 2.0, 5.0)]
    assert yielded_n == [-5.0, -2.0, -2.0]  # a weaker contact yields
    drag.reset()
    assert drag.step(DT_S, 0.0, 5.0) == 0.0


def test_the_pad_resists_as_deep_as_it_is_and_only_in_the_mud() -> None:
    clay, pad = MUDS["48.5"], DragPad(0.015, 0.02)
    assert pad.yield_n(clay) == clay.lateral_n(0.02, 0.015)
    assert pad.yield_n(clay, 0.01) == pytest.approx(clay.lateral_n(0.03, 0.015))
    assert pad.yield_n(clay, -0.02) == DragPad(0.0, 0.02).yield_n(clay) == 0.0
