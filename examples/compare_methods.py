"""Replays a log with the default and the paper's method, and prints the coefficients of each stride next to each other.

python examples/compare_methods.py LOG.mcap
"""

import sys

import mudskipper

by_default = mudskipper.replay(sys.argv[1], method="default")
by_paper = mudskipper.replay(sys.argv[1], method="paper")

print("flipper stride    k_p default   paper    k_s default   paper    k_e default   paper   (N/cm³)")
for ours, theirs in zip(by_default.strides, by_paper.strides, strict=True):
    pairs = [(ours.k_p, theirs.k_p), (ours.k_s, theirs.k_s), (ours.k_e, theirs.k_e)]
    columns = "".join(f"{1e-6 * one.value:15.2f}{1e-6 * other.value:8.2f}" for one, other in pairs)
    print(f"{ours.flipper:7} {ours.index:6}{columns}")
