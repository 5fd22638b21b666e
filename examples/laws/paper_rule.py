"""A control law after the paper's rule: as deep as the mud still lets go of the flippers.

mudskipper run examples/laws/paper_rule.py

The mud holds a plate back with k_e times its volume below the surface. For a plate of width w and thickness t that
stands upright at depth z, that is k_e w t z, and around the adduction axis, with the arm l, k_e w t z l.
"""

WIDTH_M, THICKNESS_M, ARM_M = 0.025, 0.004, 0.12
MOTOR_NM = 0.5  # of the motors' torque limit, what an extraction may take
SHALLOWEST_M, DEEPEST_M = 0.015, 0.045


def law(strides):
    """Return the depth of the next stride from the largest extraction resistance of the flippers."""
    known = [stride["k_e"]["value"] for stride in strides if stride["k_e"]["valid"]]
    if not known:
        return None
    depth_m = MOTOR_NM / (max(known) * WIDTH_M * THICKNESS_M * ARM_M)
    return max(SHALLOWEST_M, min(depth_m, DEEPEST_M))
