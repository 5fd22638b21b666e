"""The cost of one flipper's estimator: a sample, a stride's close, its memory, and its fits compared with libraries.

The flipper walks strides of 3 cm (benchmarks/speed/synthetic_walk.py). Every figure is the median over the strides
of one run
in one process, with garbage collection off as in the daemon. The samples within a stroke are timed together; the one
that ends the stroke is timed alone, and what it takes beyond an ordinary sample is the close. The paper's method takes
turns with ours, stride by stride, so both see the same machine. In the last table every fit gets the same samples of
one insertion, all it knows of them divided by their number.
"""

from __future__ import annotations

import argparse
import gc
import sys
import tracemalloc
from collections.abc import Sequence
from pathlib import Path
from random import Random
from statistics import median
from time import perf_counter
from typing import Any

from benchmarks.report import Progress, evaluated, new_parser, run_benchmark
from benchmarks.speed.fit_libraries import FITS
from benchmarks.speed.synthetic_walk import (
    DRIVE,
    GEOMETRY,
    K_E,
    K_P,
    K_S,
    NOISE_A,
    SURFACE_M,
    Sample,
    held,
    later,
    motion,
    stride_samples,
)
from control.plate import stroke_moment_m4, submerged_plate
from control.rate import PERIOD_S
from control.records import Phase, StrideEstimate
from estimation.flipper import STEPS_M, FlipperEstimator
from estimation.paper import PaperEstimator
from estimation.strokes.stroke import Stroke
from experiments.reports.text_tables import table
from firmware_host.computer.realtime import freeze_garbage

BAR_SAMPLE_US, BAR_CLOSE_US = 2.0, 150.0
TICKS_PER_MESSAGE = 5  # as in most of the authors' logs
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


def measure_strides(strides: int, progress: Progress) -> dict[str, Any]:
    samples = stride_samples()
    walks = {name: TimedWalk(flipper, samples) for name, flipper in new_flippers().items()}
    for stride in range(WARM_UP_STRIDES + strides):
        progress.show(stride, "strides")
        for walk in walks.values():
            if stride == WARM_UP_STRIDES:
                walk.forget()
            walk.walk(stride)
    return {name: walk.report() for name, walk in walks.items()}


def measure_repeats(strides: int) -> dict[str, float]:
    """Measures a tick without a new message, and the fraction of such ticks in a walk of slow messages."""
    flipper, samples = new_flippers()["default"], held(stride_samples(), TICKS_PER_MESSAGE)
    new_us, again_us = list[float](), list[float]()
    for stride in range(strides):
        rows = later(samples, stride * (samples[-1].now_s + PERIOD_S))
        for place in range(0, len(rows) - TICKS_PER_MESSAGE, TICKS_PER_MESSAGE):
            new, *again = rows[place : place + TICKS_PER_MESSAGE]
            start_s = perf_counter()
            flipper.update(*new)
            between_s = perf_counter()
            for sample in again:
                flipper.update(*sample)
            again_us.append(1e6 * (perf_counter() - between_s) / len(again))
            new_us.append(1e6 * (between_s - start_s))
    repeats_us = (TICKS_PER_MESSAGE - 1) * median(again_us)
    fraction = repeats_us / (repeats_us + median(new_us))
    return {
        "ticks_per_message": TICKS_PER_MESSAGE,
        "again_us": round(median(again_us), 3),
        "new_us": round(median(new_us), 3),
        "fraction": round(fraction, 3),
    }


def measure_stroke(rounds: int) -> float:
    """Microseconds that keeping one sample for the fit takes: Stroke.update over a whole insertion."""
    insertion = [s for s in motion() if s.phase is Phase.INSERTION]
    angles = [(s.now_s, s.sweep.angle_rad, s.adduction.angle_rad) for s in insertion]
    rows = [
        (now_s, GEOMETRY.depth_m(sweep_rad, adduction_rad), sweep_rad, adduction_rad, 0.1, 0.2, 0.0, False)
        for now_s, sweep_rad, adduction_rad in angles
    ]
    stroke, durations_us = Stroke(STEPS_M[Phase.INSERTION]), list[float]()
    for _ in range(rounds):
        stroke.reset()
        start_s = perf_counter()
        for row in rows:
            stroke.update(*row)
        durations_us.append(1e6 * (perf_counter() - start_s) / len(rows))
    return round(median(durations_us), 3)


def measure_memory(strides: int, progress: Progress, done: float) -> dict[str, float]:
    """Bytes that Python holds more after the last stride than after the first tenth of them.

    Each reading follows a collection, which also empties Python's own lists of freed tuples.
    """
    flipper, samples = new_flippers()["default"], stride_samples()
    stride_s, settled, held_bytes = samples[-1].now_s + PERIOD_S, max(1, strides // 10), 0
    tracemalloc.start()
    for stride in range(strides):
        progress.show(done + stride, "memory")
        for sample in samples:
            (moved,) = later([sample], stride * stride_s)
            flipper.update(*moved)
        if stride + 1 == settled:
            held_bytes, _ = _traced_bytes()
    now_bytes, peak_bytes = _traced_bytes()
    tracemalloc.stop()
    return {
        "strides": strides,
        "held_bytes": now_bytes,
        "peak_bytes": peak_bytes,
        "growth_bytes": now_bytes - held_bytes,
    }


def _traced_bytes() -> tuple[int, int]:
    gc.collect()
    return tracemalloc.get_traced_memory()


def insertion_law() -> tuple[list[float], list[float], float]:
    """Φ over its largest value, the torques that the mud's law and noise make of it, and that value."""
    insertion = [s for s in motion() if s.phase is Phase.INSERTION]
    plates = [(s.sweep.angle_rad, s.adduction.angle_rad) for s in insertion]
    moments_m4 = [
        stroke_moment_m4(GEOMETRY, submerged_plate(GEOMETRY, *angles, SURFACE_M), angles[0]) for angles in plates
    ]
    moments_m4 = [moment for moment in moments_m4 if moment > 0.0]
    random, noise_nm, largest_m4 = Random(1), NOISE_A * DRIVE.adduction_constant_nm_a, max(moments_m4)
    torques_nm = [K_P * moment + random.gauss(0.0, noise_nm) for moment in moments_m4]
    return [moment / largest_m4 for moment in moments_m4], torques_nm, largest_m4


def measure_fits(rounds: int, progress: Progress, done: float) -> dict[str, Any]:
    """Microseconds per sample, times our running fit's, and the slope; None where a library is not installed."""
    x, y, largest_m4 = insertion_law()
    fits: dict[str, Any] = {}
    for place, (name, new_fit) in enumerate(FITS.items()):
        progress.show(done + place, name)
        try:
            fit = new_fit()
        except ImportError:
            fits[name] = None
            continue
        k_n_cm3, durations_us = 1e-6 * fit(x, y) / largest_m4, list[float]()
        for _ in range(rounds):
            start_s = perf_counter()
            fit(x, y)
            durations_us.append(1e6 * (perf_counter() - start_s) / len(x))
        sample_us = median(durations_us)
        ratio = sample_us / fits["our LineFit"]["sample_us"] if fits else 1.0
        fits[name] = {"sample_us": round(sample_us, 4), "ratio": round(ratio, 1), "k_n_cm3": round(k_n_cm3, 6)}
    return {"samples": len(x), "fits": fits}


def text_of(report: dict[str, Any]) -> str:
    repeats, memory = report["repeats"], report["memory"]
    again = f"a tick without a new message: {repeats['again_us']:.2f} us"
    fraction = (
        f"{repeats['fraction']:.0%} of the estimator's time where a message lasts {repeats['ticks_per_message']} ticks"
    )
    peak = f"{memory['peak_bytes'] / 1024.0:.0f} KiB at most"
    return "\n".join(
        [
            table(_stride_rows(report["methods"])),
            "",
            f"keeping a sample for the fit (Stroke.update): {report['stroke_us']:.2f} us of it",
            f"{again}; {fraction}",
            f"memory over {memory['strides']} strides: {memory['growth_bytes']:+d} bytes, {peak}",
            "",
            table(fit_rows(report["fits"], report["samples"])),
        ]
    )


def _stride_rows(methods: dict[str, Any]) -> list[list[str]]:
    ours, paper = methods["default"], methods["paper"]
    rows = [["us", "default", "paper", "default/paper", "samples"]]
    for name, count in ours["samples"].items():
        rows.append(_row(f"sample in {name}", ours["sample_us"][name], paper["sample_us"][name], str(count)))
    total = str(sum(ours["samples"].values()))
    rows.append(_row("sample, mean", ours["sample_mean_us"], paper["sample_mean_us"], total))
    for name in ours["samples"]:
        rows.append(_row(f"end of {name}", ours["close_us"][name], paper["close_us"][name], ""))
    rows.append(_row("all ends of a stride", ours["close_total_us"], paper["close_total_us"], ""))
    for name, truth in TRUTH_N_M3.items():
        values = (f"{method['k_n_cm3'][name]:.3f}" for method in (ours, paper))
        rows.append([f"{name}, {1e-6 * truth:g} N/cm3 put in", *values, "", ""])
    return rows


def _row(name: str, ours_us: float, paper_us: float, samples: str) -> list[str]:
    return [name, f"{ours_us:.2f}", f"{paper_us:.2f}", f"{ours_us / max(paper_us, 0.01):.1f}", samples]


def fit_rows(fits: dict[str, Any], samples: int) -> list[list[str]]:
    rows = [[f"fits of {samples} samples", "us per sample", "to LineFit", "k_p N/cm3"]]
    for name, figures in fits.items():
        if figures is None:
            rows.append([name, "not installed", "", ""])
        else:
            rows.append([name, f"{figures['sample_us']:.3f}", f"{figures['ratio']:.1f}", f"{figures['k_n_cm3']:.6f}"])
    return rows


def measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    strides, memory_strides = options.strides, options.memory_strides
    progress = Progress(WARM_UP_STRIDES + strides + memory_strides + len(FITS))
    freeze_garbage()
    report: dict[str, Any] = {"strides": strides, "methods": measure_strides(strides, progress)}
    report["repeats"] = measure_repeats(strides)
    report["stroke_us"] = measure_stroke(strides)
    report |= measure_fits(max(1, strides // 10), progress, WARM_UP_STRIDES + strides)
    report["memory"] = measure_memory(memory_strides, progress, WARM_UP_STRIDES + strides + len(FITS))
    report |= {"bar_sample_us": BAR_SAMPLE_US, "bar_close_us": BAR_CLOSE_US}
    ours = report["methods"]["default"]
    reached = ours["sample_mean_us"] <= BAR_SAMPLE_US and ours["close_total_us"] <= BAR_CLOSE_US
    bar = f"a sample at most {BAR_SAMPLE_US:g} us and a stride's ends at most {BAR_CLOSE_US:g} us"
    return evaluated(report, bar, reached)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = new_parser("benchmarks.speed.estimator_cost", __doc__)
    parser.add_argument("--strides", type=int, default=200, help="timed, of each method")
    parser.add_argument("--memory-strides", type=int, default=1000, help="in which the memory may not grow")
    return run_benchmark(parser, arguments, measure, text_of)


if __name__ == "__main__":
    sys.exit(main())
