"""A control law after the paper's rule: as deep as the mud still lets go of the flippers.

mudskipper run examples/laws/paper_rule.py

The suction of a plate at depth z is k_e times the moment of its area below the surface. For a plate that stands upright
in the mud that is about w z² l / 2 around the adduction axis, with the width w and the arm l.
"""

from math import sqrt

WIDTH_M, ARM_M = 0.03, 0.12
MOTOR_NM = 0.5  # of the motors' torque limit, what an extraction may take
SHALLOWEST_M, DEEPEST_M = 0.015, 0.045


def law(strides):
    """Return the depth of the next stride from the largest extraction resistance of the flippers."""
    known = [stride["k_e"]["value"] for stride in strides if stride["k_e"]["valid"]]
    if not known:
        return None
    depth_m = sqrt(2.0 * MOTOR_NM / (max(known) * WIDTH_M * ARM_M))
    return max(SHALLOWEST_M, min(depth_m, DEEPEST_M))
