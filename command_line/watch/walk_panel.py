"""How the robot walks: depth now and next, stride, step, slip and speed, and the last strides."""

from typing import Any

from command_line.screen import coefficient
from command_line.watch.history import History
from command_line.watch.lines import Line
from experiments.reports.text_tables import number

REASONS = {
    "start": "as a walk starts",
    "fixed": "the operator chose it",
    "fastest": "the fastest that comes out of the mud",
    "thrust": "the deepest that comes out: too soft",
    "extraction": "the shallowest: the mud holds flippers",
    "deepest that comes out": "the deepest that comes out of the mud",
    "nothing known of the thrust, depth kept": "kept, the thrust is not known yet",
}
SLIPS = ", slips"
SLIPPING = 0.5  # of a full step: then the stride is one that slips


def walk_lines(history: History) -> list[Line]:
    report = history.status
    walks = report["mode"] in ("walking", "stopping")
    stride = f"stride {report['stride']}, {report['phase']}" if walks else "no stride"
    slip = _slip(history.step_m, report["full_step_m"])
    return [
        (
            ("depth   ", "title"),
            *(
                (f"{_cm(report['depth_m'], 2)} cm now, {_cm(report['next_depth_m'], 2)} cm next: ", "")
                if walks
                else ("-", ""),
            ),
            (_reason(report["depth_reason"]) if walks else "", "dim"),
        ),
        (
            ("walk    ", "title"),
            (f"{stride}; step {_cm(history.step_m, 1)} cm, slip ", ""),
            (f"{number(None if slip is None else 100.0 * slip, 0)} %", "warn" if slip and slip > SLIPPING else ""),
            (f", speed {_cm(history.speed_m_s, 1)} cm/s, at {number(report['body_x_m'], 2)} m", ""),
        ),
    ]


def _reason(reason: str) -> str:
    slips = "; it will slip" if reason.endswith(SLIPS) else ""
    known = reason.removesuffix(SLIPS)
    return REASONS.get(known, known) + slips


def _slip(step_m: float | None, full_step_m: float) -> float | None:
    """Return the fraction of a full step that is lost."""
    return None if step_m is None or full_step_m <= 0.0 else max(0.0, 1.0 - step_m / full_step_m)


def stride_lines(history: History, count: int) -> list[Line]:
    """Return the head and the last strides, newest first; `count` lines in all."""
    head = f"{'stride':9}{'k_p':>17}{'k_s':>17}{'k_e':>17}  {'depth':>5} {'next':>5} {'step':>5}"
    newest = list(history.strides)[:-count:-1] if count > 1 else []
    lines: list[Line] = [((head, "dim"),), *(_stride(stride) for stride in newest)]
    return [*lines, *((),) * count][:count]


def _stride(stride: dict[str, Any]) -> Line:
    texts = "".join(f"{coefficient(stride[name]):>17}" for name in ("k_p", "k_s", "k_e"))
    depth, chosen, step = (_cm(stride[name], 1) for name in ("depth_m", "chosen_depth_m", "step_m"))
    text = f"{stride['index']:3d} {stride['flipper']:5}{texts}  {depth:>5} {chosen:>5} "
    return (text, ""), (f"{step:>5}", "") if stride["released"] else ("stuck", "bad")


def _cm(value_m: float | None, digits: int) -> str:
    return number(None if value_m is None else 100.0 * value_m, digits)
