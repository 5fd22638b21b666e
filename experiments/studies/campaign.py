"""Many simulated walks: a grid, or a random sample, of worlds, robots and configurations.

The file of the campaign names the walks (experiments/campaign). Their Parquet file, which the catalogue of logs reads,
is written at the end, and also where something ends the campaign early.
"""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pandas import DataFrame

from experiments.campaign.campaign_file import Campaign, Plates, load_campaign
from experiments.campaign.plots import draw_speeds, name_text
from experiments.campaign.points import Tables, Values, leaves, with_values
from experiments.campaign.trials_table import write_trials
from experiments.campaign.walk_trial import BROKEN, run_walk
from experiments.reports.counted_nouns import counted
from experiments.reports.text_tables import number, value_shown
from experiments.study.option import Option
from experiments.study.provenance import program_text, provenance
from experiments.study.result import Figure, Result, Table
from experiments.study.trials import Trials
from firmware_host.software_version import build_metadata
from logs.catalogue.entry import TRIALS

SHOWN_POINTS = 30
SPEEDS = (
    "A dot is a point with its standard deviation over the seeds, a large dot the mean over all points of a value. "
    "Thin lines join points that differ in this key alone."
)


def folder_name(file: Path) -> str:
    """Return the name of a new folder for the results."""
    return file.stem


def study(trials: Trials, file: Annotated[Path, Option("in TOML, such as examples/campaigns/strength.toml")]) -> Result:
    """Many simulated walks: a grid, or a random sample, of worlds, robots and configurations."""
    campaign = load_campaign(file)
    trials.require_same(**campaign.identity)
    rows = [
        {"point": point, "seed": seed, "values": values}
        for point, values in enumerate(campaign.points, 1)
        for seed in range(1, campaign.seeds + 1)
    ]
    try:
        walked = trials.run(walk_point, rows, base=campaign.base, plates=campaign.plates)
    finally:
        for measured in trials.measured:
            _write(campaign, measured, trials.folder / TRIALS)
        trials.measured.clear()  # there is no second file of results
    points = [
        _point_result(values, own) for values, (_, own) in zip(campaign.points, walked.groupby("point"), strict=True)
    ]
    summary = {
        "campaign": campaign.name,
        "trials": len(rows),
        "seeds": campaign.seeds,
        "program": program_text(provenance(__name__)),
        "results": TRIALS,
        "points": points,
        "simulated": True,
    }
    figure = Figure("speeds", SPEEDS, partial(draw_speeds, points), "Speed against each key")
    texts = {"Points": _explanation(campaign, points)}
    return Result([_table(points, len(rows))], [figure], summary, f"Campaign {campaign.name}", texts)


def walk_point(point: int, seed: int, values: Values, base: Tables, plates: Plates) -> dict[str, Any]:
    """Return the columns of the catalogue of one walk; `point` is the number of these values."""
    return run_walk(plates.in_configuration(with_values(base, values)), seed)


def _write(campaign: Campaign, walked: DataFrame, path: Path) -> None:
    record, run = provenance(__name__), campaign.name
    rows = [
        row
        | build_metadata()
        | {"sources": record["sources"], "run": run, "file": f"{run}, point {row['point']}, seed {row['seed']}"}
        | row["values"]
        for row in walked.astype(object).where(walked.notna(), None).to_dict("records")  # NULL in SQL, and not NaN
    ]
    if rows:
        write_trials(path, rows, list(campaign.points[0]), {"campaign": run} | record)


def _point_result(values: Values, walked: DataFrame) -> dict[str, Any]:
    """Summarise the walks at one point; the speed is a mean over the seeds, with their standard deviation."""
    speeds_m_s = walked["speed_m_s"].astype(float)
    return {
        "values": values,
        "trials": len(walked),
        "speed_m_s": speeds_m_s.mean(),
        "speed_sd_m_s": speeds_m_s.std(),
        "strides": walked["strides"].sum(),
        "stuck_strides": walked["stuck_strides"].sum(),
        "faults": sorted({fault for faults in walked["faults"] for fault in faults}),
        "not_started": (walked["state"] == BROKEN).sum(),  # the robot was not armed or did not walk
    }


def _explanation(campaign: Campaign, points: list[dict[str, Any]]) -> str:
    """Return the fastest point, then what all walks have in common."""
    fastest = max(points, key=lambda point: max(0.0, point["speed_m_s"]))  # NaN is no speed
    at = ", ".join(f"{key} = {name_text(value)}" for key, value in fastest["values"].items())
    common = ", ".join(f"{key} = {value_shown(value)}" for key, value in leaves(campaign.base))
    return (
        f"The fastest point has {number(100.0 * fastest['speed_m_s'], 2)} cm/s: {at}. Speeds are means over "
        f"{counted(campaign.seeds, 'seed')}.\n\nAll walks have {common or 'the defaults'}."
    )


def _table(points: list[dict[str, Any]], walks: int) -> Table:
    shown, which = points, ""
    if len(points) > SHOWN_POINTS:
        shown = sorted(points, key=lambda point: -max(0.0, point["speed_m_s"]))[:SHOWN_POINTS]  # NaN is no speed
        which = f", the fastest {SHOWN_POINTS}"
    title = f"{counted(walks, 'walk')} at {counted(len(points), 'point')}{which}; all are in {TRIALS}"
    return Table("points", title, {"speed": "cm/s", "sd": "cm/s"}, DataFrame(map(_row, shown)), "Points")


def _row(point: dict[str, Any]) -> dict[str, Any]:
    not_started = [f"{point['not_started']} not started"] * bool(point["not_started"])
    values = {key: name_text(value) for key, value in point["values"].items()}
    return values | {
        "speed": number(100.0 * point["speed_m_s"], 2),
        "sd": number(100.0 * point["speed_sd_m_s"], 2),
        "strides": point["strides"],
        "stuck": point["stuck_strides"],
        "faults": ", ".join([*point["faults"], *not_started]),
    }
