"""A control law for a hand: type + or - and Enter while the robot walks, for deeper or shallower strides.

mudskipper run examples/laws/keyboard.py
"""

import select
import sys

STEP_M, SHALLOWEST_M, DEEPEST_M = 0.0025, 0.01, 0.045
depth_m = 0.02


def law(strides):
    """Return the depth after all that was typed since the last stride."""
    global depth_m
    while select.select([sys.stdin], [], [], 0.0)[0] and (line := sys.stdin.readline()):
        depth_m += STEP_M * (line.count("+") - line.count("-"))
    depth_m = max(SHALLOWEST_M, min(depth_m, DEEPEST_M))
    return depth_m
