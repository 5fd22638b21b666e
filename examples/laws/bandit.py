"""A control law that learns the best depth by trying: an upper-confidence bandit over five depths.

mudskipper run examples/laws/bandit.py --strides 60

The reward of a stride is the step of the body. It needs a pose: without one the law stays at the first depth.
"""

from math import inf, isfinite, log, sqrt

DEPTHS_M = [0.015, 0.02, 0.025, 0.03, 0.035]
CURIOSITY_M = 0.01  # of the step, for a depth that was tried once

tries = [0] * len(DEPTHS_M)
gained_m = [0.0] * len(DEPTHS_M)
ordered = [1]  # the depth of the stride under way; the first is that of --depth, 2 cm


def promise(depth):
    """Return the mean step of a depth, and by how much it may be better."""
    if not tries[depth]:
        return inf
    return gained_m[depth] / tries[depth] + CURIOSITY_M * sqrt(log(sum(tries)) / tries[depth])


def law(strides):
    """Count the step of this stride, and return the most promising depth."""
    step_m = strides[0]["step_m"]
    if step_m is not None and isfinite(step_m):
        tries[ordered[0]] += 1
        gained_m[ordered[0]] += step_m
    best = max(range(len(DEPTHS_M)), key=promise)
    ordered[:] = [best]
    return DEPTHS_M[best]
