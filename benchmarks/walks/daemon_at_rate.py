"""Runs the daemon at another rate than its own, for benchmarks: `--rate HZ`, then the options of the daemon.

Every duration in ticks follows from control/rate.py when the modules are imported, so the rate is changed before.
"""

import sys

from control import rate


def main(arguments: list[str]) -> int:
    option, rate_hz, *others = arguments
    if option != "--rate":
        raise SystemExit("daemon_at_rate: --rate HZ comes first")
    rate.RATE_HZ = float(rate_hz)
    rate.PERIOD_S = 1.0 / rate.RATE_HZ
    from firmware_host import daemon  # only here, where the rate is known

    return daemon.main(others)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
