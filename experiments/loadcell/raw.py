"""What was recorded, on the disk: a file of forces for each trial, and one of the places of a stage with an encoder.

The notebook's entry of a trial names them.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from drivers.load_cell.load_cell_port import Sample
from drivers.load_cell.stage_encoder import Place
from experiments.loadcell.fits import Recorded
from experiments.loadcell.stage_track import Places
from experiments.trials.notebook import Notebook

RAW = "raw"
COLUMNS, PLACE_COLUMNS = ("t_s", "force_n", "overloaded"), ("t_s", "place_m")


def raw_name(key: str, attempt: int, what: str = "") -> str:
    plain = re.sub(r"[^\w.]+", "_", key)
    return f"{RAW}/{plain}_{attempt}{what}.csv"


def write_samples(path: Path, samples: Iterable[Sample]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows((f"{s.stamp_s:.6f}", f"{s.force_n:.6f}", int(s.overloaded)) for s in samples)


def write_places(path: Path, places: Iterable[Place]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(PLACE_COLUMNS)
        writer.writerows((f"{place.stamp_s:.6f}", f"{place.position_m:.8f}") for place in places)


def load_recorded(folder: Path, key: str, entry: dict[str, Any]) -> Recorded:
    """From the disk. Raises OSError, ValueError where the file is none of these."""
    with (folder / entry["file"]).open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["overloaded"] == "0"]
    times_s = np.array([float(row["t_s"]) for row in rows])
    forces_n = np.array([float(row["force_n"]) for row in rows])
    zero_n = (entry["zero_before_n"] + entry["zero_after_n"]) / 2.0
    return Recorded(key, entry["mud"], entry["kind"], times_s, forces_n, zero_n, _load_places(folder, entry))


def _load_places(folder: Path, entry: dict[str, Any]) -> Places | None:
    """None where there was no encoder, or it began anew in the middle."""
    reported = entry.get("position")
    if not reported or reported["breaks"] or not reported["places"]:
        return None
    with (folder / reported["file"]).open(newline="", encoding="utf-8") as file:
        rows = [(float(row["t_s"]), float(row["place_m"])) for row in csv.DictReader(file)]
    times_s, positions_m = np.array(rows).T
    return Places(times_s, positions_m)


def load_all(folder: Path, notebook: Notebook) -> list[Recorded]:
    """The trials that count."""
    counted = {key: entry for key, entry in notebook.entries.items() if "file" in entry and not entry.get("skipped")}
    return [load_recorded(folder, key, entry) for key, entry in counted.items()]
