"""Summarises a log of the paper's authors for `mudskipper log info`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from control.records import Phase
from logs.lab.body_track import largest_change
from logs.lab.findings import Finding
from logs.lab.lab_csv import LabLog
from logs.lab.log_rows import runs


def lab_summary(path: Path, lab: LabLog) -> dict[str, Any]:
    """Return what `mudskipper log info` prints. A stride is counted when its extraction begins."""
    rows = len(lab.stamp_s)
    duration_s = float(lab.stamp_s[-1] - lab.stamp_s[0])
    signals = np.column_stack([lab.angle_rad, lab.current_a])
    changed = np.any((np.diff(signals, axis=0) != 0.0) & np.isfinite(signals[1:]), axis=1)
    return {
        "form": "CSV of the paper's authors",
        "rows": rows,
        "duration_s": duration_s,
        "rate_hz": (rows - 1) / duration_s if duration_s > 0.0 else 0.0,
        "distinct_rate_hz": int(np.count_nonzero(changed)) / duration_s if duration_s > 0.0 else 0.0,
        "flippers": list(lab.flippers),
        "strides": len(runs(lab.phase == Phase.EXTRACTION)),
        "commanded_depth_m": float(np.nanmax(lab.commanded_depth_m)) if np.any(lab.commanded_depth_m > 0.0) else None,
        "sinking_m": _change(-lab.body_height_m, lab),
        "pitch_rad": _change(lab.body_pitch_rad, lab),
        "settings": lab.gait,
        "missing_settings": list(lab.missing_settings),
        "findings": finding_reports(path, lab.findings),
    }


def _change(values: NDArray[np.float64], lab: LabLog) -> float | None:
    """Return the largest change after the first insertion, with its sign; None where the pose is not known."""
    return largest_change(values, lab.phase)[0] if np.any(np.isfinite(values)) else None


def finding_reports(path: Path, findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Return findings as JSON objects; null where a finding has no column, time or line."""
    return [
        {
            "file": str(path),
            "kind": str(finding.kind),
            "column": finding.column or None,
            "time_s": finding.time_s if math.isfinite(finding.time_s) else None,
            "line": finding.line or None,
            "text": finding.text,
        }
        for finding in findings
    ]
