"""Runs the daemon at another rate than its own, for benchmarks: `--rate HZ`, then the options of the daemon.

Periods and rates follow from control/rate.py when the modules are imported, so the rate is changed before. Monitors
that count a fixed number of ticks then act sooner, and the log's writer, a process of its own, keeps 380 Hz.
"""

import argparse
import sys
from collections.abc import Sequence

from control import rate


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="verification.speed.daemon_at_rate", description=__doc__, allow_abbrev=False)
    parser.add_argument("--rate", type=float, required=True)
    options, others = parser.parse_known_args(arguments)
    rate.RATE_HZ = options.rate
    rate.PERIOD_S = 1.0 / rate.RATE_HZ
    from firmware_host import daemon  # only here, where the rate is known

    return daemon.main(others)


if __name__ == "__main__":
    sys.exit(main())
