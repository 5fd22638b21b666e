"""Measures the cost of one flipper's estimator: the time of a sample and of a stride's end.

The flipper walks strides of 3 cm (benchmarks/speed/synthetic_walk.py). Every figure is the median over the strides of
one run in one process, with garbage collection off as in the daemon. The samples within a stroke are timed together;
the one that ends the stroke is timed alone, and its time beyond an ordinary sample is the close. The paper's method
alternates with ours, stride by stride, so both see the same machine.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

from benchmarks.report import evaluated, run_benchmark, show_progress
from benchmarks.speed.synthetic_walk import DRIVE, GEOMETRY, K_E, K_P, K_S, Sample, later, stride_samples
from control.rate import PERIOD_S
from control.records import Phase, StrideEstimate
from estimation.flipper import FlipperEstimator
from estimation.paper import PaperEstimator
from firmware_host.computer.realtime import freeze_garbage

BAR_SAMPLE_US, BAR_CLOSE_US = 2.0, 150.0
WARM_UP_STRIDES = 10
PHASES = (Phase.INSERTION, Phase.STANCE, Phase.EXTRACTION, Phase.SWING)
TRUTH_N_M3 = {"k_p": K_P, "k_s": K_S, "k_e": K_E}
Flipper = FlipperEstimator | PaperEstimator


def new_flippers() -> dict[str, Flipper]:
    return {
        "default": FlipperEstimator("left", GEOMETRY, DRIVE),
        "paper": PaperEstimator("left", GEOMETRY, DRIVE),
    }


class TimedWalk:
    """Owns the durations of the strides that one estimator walked."""

    def __init__(self, flipper: Flipper, samples: Sequence[Sample]) -> None:
        self.flipper = flipper
        self.stride_s = samples[-1].now_s + PERIOD_S
        self.strokes = {phase: [s for s in samples if s.phase is phase] for phase in PHASES}
        self.closed: list[StrideEstimate] = []
        self.forget()

    def forget(self) -> None:
        self.sample_us: dict[Phase, list[float]] = {phase: [] for phase in PHASES}
        self.close_us: dict[Phase, list[float]] = {phase: [] for phase in PHASES}  # of the phase that ends

    def walk(self, stride: int) -> None:
        for ended, phase in zip(PHASES[-1:] + PHASES[:-1], PHASES, strict=True):
            first, *others = later(self.strokes[phase], stride * self.stride_s)
            start_s = perf_counter()
            _, closed = self.flipper.update(*first)
            between_s = perf_counter()
            for sample in others:
                self.flipper.update(*sample)
            self.sample_us[phase].append(1e6 * (perf_counter() - between_s) / len(others))
            self.close_us[ended].append(1e6 * (between_s - start_s))
            if closed is not None:
                self.closed.append(closed)

    def report(self) -> dict[str, Any]:
        counts = {phase: len(stroke) for phase, stroke in self.strokes.items()}
        sample_us = {phase: median(durations) for phase, durations in self.sample_us.items()}
        mean_us = sum(counts[phase] * sample_us[phase] for phase in PHASES) / sum(counts.values())
        close_us = {phase: max(0.0, median(self.close_us[phase]) - mean_us) for phase in PHASES}
        return {
            "sample_us": {phase.name.lower(): round(us, 3) for phase, us in sample_us.items()},
            "sample_mean_us": round(mean_us, 3),
            "close_us": {phase.name.lower(): round(us, 1) for phase, us in close_us.items()},
            "close_total_us": round(sum(close_us.values()), 1),
            "samples": {phase.name.lower(): count for phase, count in counts.items()},
            "k_n_cm3": {name: round(1e-6 * getattr(self.closed[-1], name).value, 3) for name in TRUTH_N_M3},
        }


def measure_strides(strides: int) -> dict[str, Any]:
    samples = stride_samples()
    walks = {name: TimedWalk(flipper, samples) for name, flipper in new_flippers().items()}
    for stride in range(WARM_UP_STRIDES + strides):
        show_progress(stride, WARM_UP_STRIDES + strides, "strides")
        for walk in walks.values():
            if stride == WARM_UP_STRIDES:
                walk.forget()
            walk.walk(stride)
    return {name: walk.report() for name, walk in walks.items()}


def measure(folder: Path, *, strides: int = 200) -> dict[str, Any]:
    freeze_garbage()
    report: dict[str, Any] = {"strides": strides, "methods": measure_strides(strides)}
    report |= {"bar_sample_us": BAR_SAMPLE_US, "bar_close_us": BAR_CLOSE_US}
    ours = report["methods"]["default"]
    reached = ours["sample_mean_us"] <= BAR_SAMPLE_US and ours["close_total_us"] <= BAR_CLOSE_US
    bar = f"a sample at most {BAR_SAMPLE_US:g} us and a stride's ends at most {BAR_CLOSE_US:g} us"
    return evaluated(report, bar, reached)


if __name__ == "__main__":
    sys.exit(run_benchmark(measure))
