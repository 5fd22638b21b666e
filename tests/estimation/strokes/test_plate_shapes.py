"""Known coefficients from strokes of plates of several shapes; torques are summed over small pieces of the plate."""

from functools import cache
from math import cos, hypot, radians, sin

import numpy as np
import pytest

from control.computing.bounded_work import finish
from control.geometry import FlipperGeometry
from control.plate_outline import Corner
from estimation.strokes.scatter_memory import ScatterMemory
from estimation.strokes.shear import Base, find_shear
from estimation.strokes.stroke import Batch
from estimation.strokes.stroke_fit import fit_extraction, fit_insertion
from estimation.strokes.surface import Surface

K_P, K_S, K_E = 1.2e6, 0.6e6, 1.9e6
SURFACE_M = 0.002
KNOWN = Surface(SURFACE_M, 0.0, 0.0, 0.0, True)
TRAPEZOID = ((-0.0075, 0.0), (0.0075, 0.0), (0.0175, 0.07), (-0.0175, 0.07))
PADDLE = tuple((0.015 * sin(t), 0.035 - 0.035 * cos(t)) for t in np.linspace(0.0, 2.0 * np.pi, 20, endpoint=False))
SHAPES = {
    "rectangle": FlipperGeometry(),
    "trapezoid": FlipperGeometry(plate_corners_m=TRAPEZOID),
    "paddle": FlipperGeometry(plate_corners_m=PADDLE),
    "turned": FlipperGeometry(plate_corners_m=TRAPEZOID, plate_angle_deg=15.0),
}
pytestmark = pytest.mark.parametrize("geometry", SHAPES.values(), ids=SHAPES)
PIECE_M = 0.0001


def drawn(geometry: FlipperGeometry) -> tuple[Corner, ...]:
    return geometry.plate_corners_m or ((-0.0125, 0.0), (0.0125, 0.0), (0.0125, 0.07), (-0.0125, 0.07))


@cache
def pieces_of(geometry: FlipperGeometry) -> tuple[np.ndarray, np.ndarray, float]:
    """Return the positions outward and upward of the pieces within the mounted plate, and the area of one piece."""
    turn = radians(geometry.plate_angle_deg)
    corners = [(u * cos(turn) - s * sin(turn), u * sin(turn) + s * cos(turn)) for u, s in drawn(geometry)]
    lowest_m = min(s for _, s in corners)
    steps_m = PIECE_M * (np.arange(1000) + 0.5)
    u, s = np.meshgrid(steps_m - 0.05, steps_m)
    inside = np.zeros(u.shape, dtype=bool)
    for (a, b), (c, d) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if abs(c - a) > 1e-12:
            inside ^= ((a < u) != (c < u)) & (s > b - lowest_m + (d - b) * (u - a) / (c - a))
    return u[inside], s[inside], PIECE_M**2


def moments_m4(geometry: FlipperGeometry, sweep_rad: float, adduction_rad: float) -> tuple[float, float]:
    """Return Ψ and Φ of control/plate, summed piece by piece."""
    u, s, piece_m2 = pieces_of(geometry)
    edge_m = geometry.depth_m(sweep_rad, adduction_rad) - SURFACE_M
    depths_m = edge_m - u * cos(sweep_rad) * sin(adduction_rad) - s * cos(adduction_rad)
    wet = depths_m > 0.0
    if not wet.any():
        return 0.0, 0.0
    stance_m4 = piece_m2 * (depths_m * (geometry.flipper_length_m + u))[wet].sum()
    reach_m = hypot(geometry.flipper_length_m + u[wet].mean(), geometry.drop_m - s[wet].mean())
    return stance_m4, geometry.plate_thickness_m * piece_m2 * wet.sum() * cos(sweep_rad) * reach_m


def batch(geometry: FlipperGeometry, depth_m: float, sweep_rad: float, travel_m: float) -> Batch:
    return Batch(travel_m, sweep_rad, geometry.adduction_rad(sweep_rad, depth_m), 0.0, 0.0, 0.0, False, 6, 0.1)


def stroke(geometry: FlipperGeometry, k_n_m3: float) -> list[Batch]:
    """Return the batches of a stroke from 1 cm above the mud to a depth of 3 cm, at the front end of the sweep."""
    poses = [batch(geometry, depth_m, radians(30.0), depth_m) for depth_m in np.arange(-0.01, 0.03, 0.0015).tolist()]
    return [p._replace(adduction_nm=k_n_m3 * moments_m4(geometry, p.sweep_rad, p.adduction_rad)[1]) for p in poses]


def test_strokes_give_the_known_k_p_and_k_e(geometry: FlipperGeometry) -> None:
    lowered, raised = stroke(geometry, K_P), stroke(geometry, -K_E)[::-1]
    k_p = finish(fit_insertion(geometry, lowered, KNOWN, 0.0))
    k_e = finish(fit_extraction(geometry, raised, KNOWN, 0.0, ScatterMemory(), raised[0].travel_m))
    assert k_p.valid and k_e.valid
    assert (k_p.value, k_e.value) == pytest.approx((K_P, K_E), rel=0.005)


def test_a_stance_gives_the_known_k_s(geometry: FlipperGeometry) -> None:
    sweeps_rad = np.radians(np.linspace(30.0, -30.0, 21)).tolist()
    poses = [batch(geometry, 0.03, a, geometry.flipper_length_m * a) for a in sweeps_rad]
    pushed = [p._replace(sweep_nm=K_S * moments_m4(geometry, p.sweep_rad, p.adduction_rad)[0]) for p in poses]
    found = find_shear(geometry, pushed, SURFACE_M, Base.FIXED, 0.0)
    assert found.fit is not None and found.fit.slope == pytest.approx(K_S, rel=0.005)
