"""Plots the forces of both flippers over time, and the coefficients of each stride.

python examples/plot_forces.py LOG.mcap forces.png
"""

import sys

import matplotlib

matplotlib.use("Agg")  # writes a file; leave this out in a notebook
import matplotlib.pyplot as plt

import mudskipper

N_CM3 = 1e-6  # N/cm³ in a N/m³

log = mudskipper.open_log(sys.argv[1])
time_s = log.ticks["stamp_s"] - log.ticks["stamp_s"][0]

figure, (forces, coefficients) = plt.subplots(2, 1, sharex=True, layout="constrained")
for number, flipper in enumerate(log.rig.flippers):
    forces.plot(time_s, log.ticks["force_x_n"][:, number], label=f"{flipper}, forward")
    forces.plot(time_s, log.ticks["force_z_n"][:, number], label=f"{flipper}, up")
forces.set_ylabel("force (N)")
forces.legend()

for name in ("k_p", "k_s", "k_e"):
    valid = log.strides[f"{name}_valid"]
    stamp_s = log.strides["stamp_s"][valid] - log.ticks["stamp_s"][0]
    value, std_error = log.strides[name][valid], log.strides[f"{name}_std_error"][valid]
    coefficients.errorbar(stamp_s, N_CM3 * value, N_CM3 * std_error, fmt="o", label=name)
coefficients.set(xlabel="time (s)", ylabel="coefficient (N/cm³)")
coefficients.legend()

figure.savefig(sys.argv[2])
print(f"{len(log.ticks)} ticks and {len(log.strides)} strides of {log.metadata['robot']}: {sys.argv[2]}")
