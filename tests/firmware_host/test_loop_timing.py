"""The timing statistics agree with numpy on the same durations."""

import numpy as np
import pytest

from control.rate import PERIOD_S
from firmware_host.loop_timing import LONGEST_US, Histogram, LoopTiming


def test_percentiles_are_exact_to_a_microsecond() -> None:
    durations_s = np.random.default_rng(1).gamma(2.0, 80e-6, 10000)
    histogram = Histogram()
    for duration_s in durations_s:
        histogram.add(float(duration_s))
    for fraction in (0.5, 0.99, 0.999):
        exact_us = 1e6 * float(np.quantile(durations_s, fraction, method="inverted_cdf"))
        assert histogram.percentile_us(fraction) == pytest.approx(exact_us, abs=1.0)
    assert histogram.max_us == pytest.approx(1e6 * durations_s.max())


def test_a_duration_beyond_the_buckets_keeps_its_maximum() -> None:
    histogram = Histogram()
    histogram.add(3.0 * LONGEST_US / 1e6)
    assert histogram.summary()["max"] == pytest.approx(3.0 * LONGEST_US)
    assert histogram.percentile_us(0.5) == pytest.approx(3.0 * LONGEST_US)


def test_missed_ticks_lower_the_reported_rate() -> None:
    timing = LoopTiming()
    for number in range(381):
        if number % 10 != 9:
            timing.update(number * PERIOD_S, 0.0, 1 if number % 10 == 0 and number else 0, 1e-4)
    assert timing.rate_hz == pytest.approx(380.0 * 0.9, rel=2e-3)
    assert timing.missed_ticks == 38
