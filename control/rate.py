"""The rate of the control loop, from which every duration in ticks follows.

Nothing else in the project states a rate or a period: the ticker, the limits, the transmit gate, the monitors, the
log and the simulator derive theirs from here. `Loop` and `Lockstep` accept another period for tests, and
verification/speed/daemon_at_rate.py replaces the rate before the import.
"""

RATE_HZ = 380.0  # the rate at which the paper's robot logged and controlled
PERIOD_S = 1.0 / RATE_HZ
