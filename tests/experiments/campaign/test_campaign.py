"""Campaigns: the points of a file, its refusals, equal digits wherever walks run, and what an interruption leaves."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pandas import DataFrame

from command_line import exit_codes
from command_line.main import main
from experiments.campaign.campaign_file import Campaign, load_campaign
from experiments.campaign.points import with_values
from experiments.campaign.walk_trial import run_walk
from experiments.studies import campaign as campaign_module
from experiments.study.notebook import NAME, Notebook
from firmware_host.configuration.file_problems import ConfigurationError
from logs.catalogue.catalogue import Catalogue
from logs.catalogue.entry import COLUMNS, TRIALS, LogEntry, values_of_entry
from tests.folders import ROOT

pytestmark = pytest.mark.usefixtures("png_alone")

SHORT = """
seeds = 2
[walk]
strides = 1
[grid]
world.segment.strength_pa = [1000.0, 3000.0]
"""


def written(folder: Path, text: str, name: str = "mud.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder: Path, text: str) -> Campaign:
    return load_campaign(written(folder, text))


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(ConfigurationError) as refused:
        loaded(folder, text)
    (message,) = refused.value.problems
    return message


def tables_of(campaign: Campaign) -> list[dict[str, Any]]:
    """Return the tables of the walk at each point."""
    return [campaign.plates.in_configuration(with_values(campaign.base, values)) for values in campaign.points]


# points


def test_a_grid_has_every_combination_of_its_values(tmp_path: Path) -> None:
    campaign = loaded(
        tmp_path,
        """
        [grid]
        robot.drive = ["odrive", "mit:AK80-9"]
        configuration.adaptation.method = ["default", "paper"]
        world.segment.1.strength_pa = [800.0, 1600.0, 3200.0]
        """,
    )
    assert len(campaign.points) == 12 and len({json.dumps(point) for point in campaign.points}) == 12
    last = tables_of(campaign)[-1]
    assert last["robot"] == {"drive": "mit:AK80-9"} and last["configuration"] == {"adaptation": {"method": "paper"}}
    assert last["world"]["segment"] == [{"start_m": 0.0, "end_m": 100.0, "strength_pa": 3200.0}]


RANDOM = """
points = 15
[random]
world.segment.water_percent = { min = 46.0, max = 53.0 }
world.random_strength.relative_spread = { min = 0.01, max = 0.5, logarithmic = true }
walk.strides = { min = 2, max = 4 }
configuration.adaptation.method = ["default", "paper"]
"""


def test_a_random_sample_is_within_its_ranges_and_the_same_for_the_same_seed(tmp_path: Path) -> None:
    points = loaded(tmp_path, RANDOM).points
    assert points == loaded(tmp_path, RANDOM).points != loaded(tmp_path, f"seed = 2\n{RANDOM}").points
    assert all(46.0 <= point["world.segment.water_percent"] <= 53.0 for point in points)
    assert {point["walk.strides"] for point in points} == {2, 3, 4}
    spreads = sorted(point["world.random_strength.relative_spread"] for point in points)
    assert spreads[0] >= 0.01 and spreads[-1] <= 0.5 and spreads[len(spreads) // 2] < 0.15
    assert {point["configuration.adaptation.method"] for point in points} == {"default", "paper"}


def test_another_key_changes_no_draw_of_the_first(tmp_path: Path) -> None:
    more = f"{RANDOM}world.disturbances.clinging_n = {{ min = 0.0, max = 1.0 }}\n"
    for before, after in zip(loaded(tmp_path, RANDOM).points, loaded(tmp_path, more).points, strict=True):
        assert before.items() <= after.items()


def test_a_plate_comes_from_a_file_next_to_the_campaign(tmp_path: Path) -> None:
    written(tmp_path, (ROOT / "examples/plates/paddle.csv").read_text(encoding="utf-8"), "paddle.csv")
    campaign = loaded(tmp_path, f'{SHORT}robot.plate = ["", "paddle.csv"]\n')
    corners = [tables["configuration"].get("geometry", {}).get("plate_corners_m") for tables in tables_of(campaign)]
    assert corners[0] is None and len(corners[1]) == 17 and "plate" not in tables_of(campaign)[1]["robot"]


def test_the_example_is_a_campaign() -> None:
    for path in (ROOT / "examples/campaigns").glob("*.toml"):
        assert load_campaign(path).points


MUD = "world.segment.strength_pa"
REFUSED = {
    f"[grid]\n{MUD} = [800.0]\n[random]\n{MUD} = [800.0]": "must have either [grid] or [random]",
    "wolrd = 3": "wolrd: there is no such key",
    "[grid]": "grid: must have at least one key",
    f"[grid]\n{MUD} = []": f"grid.{MUD} = []: must have at least one value",
    f"[grid]\n{MUD} = 800.0": f"grid.{MUD} = 800.0: must be an array of values",
    "[grid]\nmud.strength_pa = [800.0]": "mud.strength_pa: must begin with one of walk., robot., world.",
    f"[grid]\n{MUD} = [20.0]": "world.segment 1.strength_pa = 20.0: must be at least 50.0; at point 1",
    "[grid]\nworld.segment.2.strength_pa = [800.0]": "there are tables 1 to 1, not 2",
    "[grid]\nworld.ridges.amplitude_m = [0.001]": "world.segment 1: water_percent, strength_pa or sand is missing",
    f"[grid]\n{MUD} = [800.0]\nconfiguration.adaptation.methd = ['paper']": "configuration.adaptation.methd: there is",
    f"[grid]\n{MUD} = [800.0]\nrobot.drive = ['steam']": "robot.drive = 'steam': must be one of odrive",
    f"[grid]\n{MUD} = [800.0]\nrobot.flippers = [['middle']]": "robot.flippers = ['middle']: must be one of",
    f"[grid]\n{MUD} = [800.0]\nrobot.plate = ['none.csv']": "none.csv: No such file",
    f"[grid]\n{MUD} = [800.0]\nrobot.plate = ['p.csv']\n[configuration]\ngeometry = 3": "there is a value where",
    f"[grid]\n{MUD} = [800.0]\nwalk.strides = [0]": "walk.strides = 0: must be at least 1",
    f"[grid]\n{MUD}.x = [800.0]\n[world]\nsegment = [{{ strength_pa = 3.0 }}]": "would be a key of a table",
    f"seeds = 10000\n[grid]\n{MUD} = {[800.0 + i for i in range(11)]}": "must give at most 100000 trials",
    f"points = 3\n[grid]\n{MUD} = [800.0]": "points = 3: must be left out with [grid]",
    f"[random]\n{MUD} = 800.0": "must be an array, or { min = ..., max = ... }",
    f"[random]\n{MUD} = {{ min = 800.0, max = 700.0 }}": f"random.{MUD}.min = 800.0: must be less than max = 700.0",
    f"[random]\n{MUD} = {{ min = 1.0, max = 2.0, log = true }}": f"random.{MUD}.log: there is no such key",
    f"[random]\n{MUD} = {{ min = 0.0, max = 2.0, logarithmic = true }}": "must be more than 0 where it is logarithmic",
    f"points = 1\n[random]\n{MUD} = {{ min = 40.0, max = 50000.0 }}": "strength_pa = 40.0: must be at least 50.0",
}


def test_each_bad_file_is_refused_in_one_sentence(tmp_path: Path) -> None:
    written(tmp_path, (ROOT / "examples/plates/paddle.csv").read_text(encoding="utf-8"), "p.csv")
    for text, message in REFUSED.items():
        assert message in refusal(tmp_path, text), text


def test_a_missing_file_and_text_that_is_no_toml_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = {tmp_path / "none.toml": exit_codes.UNHEALTHY, written(tmp_path, "[grid"): exit_codes.CONFIGURATION}
    for path, status in paths.items():
        assert main(["experiment", "campaign", str(path)]) == status
        assert capsys.readouterr().err.count("\n") == 1


# walks


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., int]:
    def run(*options: str, text: str = SHORT) -> int:
        path = written(tmp_path, text)
        return main(["experiment", "campaign", str(path), "--out", str(tmp_path / "out"), "--json", *options])

    return run


def rows(folder: Path, columns: str = "*") -> list[tuple[Any, ...]]:
    return Catalogue(folder).query(f"SELECT {columns} FROM trials ORDER BY point, seed").rows


def fast_walk(tables: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return the entry of a walk whose speed follows from its arguments."""
    speed_m_s = seed / tables["world"]["segment"][0]["strength_pa"]
    known = {"state": "whole", "strides": 2, "stuck_strides": 0, "speed_m_s": speed_m_s, "faults": [], "muds": []}
    return dict.fromkeys(COLUMNS) | known


def test_walks_of_workers_have_the_digits_of_this_process_and_the_catalogue_reads_them(
    command: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command("--workers", "2") == exit_codes.OK
    report = json.loads(capsys.readouterr().out)
    campaign = load_campaign(tmp_path / "mud.toml")
    here = [run_walk(tables_of(campaign)[0], seed) for seed in (1, 2)]
    lines = (tmp_path / "out" / NAME).read_text(encoding="utf-8").splitlines()
    entries = [line["entry"] for line in sorted(map(json.loads, lines[1:]), key=lambda line: str(line["key"]))]
    assert entries[:2] == json.loads(json.dumps(here))
    found = rows(tmp_path, "point, seed, world_segment_strength_pa, strides, speed_m_s, muds[1].k_p, state")
    assert [row[:4] for row in found] == [(1, 1, 1000.0, 2), (1, 2, 1000.0, 2), (2, 1, 3000.0, 2), (2, 2, 3000.0, 2)]
    assert all(row[4] > 0.0 and row[6] == "whole" for row in found) and found[0][5] < found[2][5]
    joined = Catalogue(tmp_path).query("SELECT file, speed_m_s FROM logs UNION ALL BY NAME SELECT * FROM trials")
    assert set(joined.names) == {*COLUMNS, "point", "seed", "sources", "world_segment_strength_pa"}
    assert report["points"][0]["strides"] == 4 and report["results"] == TRIALS


def test_an_interrupted_campaign_continues_where_it_was_and_refuses_a_changed_file(
    command: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    kept, shown = Notebook.write, list[tuple[int, int]]()

    def interrupt_after_two(notebook: Notebook, key: str, entry: dict[str, Any]) -> None:
        kept(notebook, key, entry)
        if len(notebook.entries) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(campaign_module, "run_walk", fast_walk)
    with monkeypatch.context() as patch:
        patch.setattr(Notebook, "write", interrupt_after_two)
        assert command("--workers", "1") == exit_codes.INTERRUPTED
    assert len(rows(tmp_path)) == 2
    for changed, differs in (
        (SHORT.replace("3000.0", "2000.0"), "strength_pa = [1000.0, 2000.0]"),
        (f"{SHORT}[configuration.adaptation]\nmethod = 'paper'", "method = paper"),
        (f"{SHORT}[world.disturbances]\nclinging_n = 0.5", "clinging_n = 0.5"),
    ):
        capsys.readouterr()
        assert command(text=changed) == exit_codes.REFUSED
        assert differs in capsys.readouterr().err
    monkeypatch.setattr("command_line.screen.Progress.show", lambda _, *count: shown.append(count))
    assert command("--workers", "1") == exit_codes.OK
    assert shown[0] == (2, 4)  # the time left is that of its own walks
    lines = (tmp_path / "out" / NAME).read_text(encoding="utf-8").splitlines()
    assert len(rows(tmp_path)) == 4 and len(lines) == 5  # the plan, and each trial once


def test_a_robot_that_does_not_start_is_a_row_with_its_reason(tmp_path: Path) -> None:
    campaign = loaded(
        tmp_path, "[walk]\nstrides = 1\n[grid]\nworld.segment.strength_pa = [800.0]\nwalk.depth_m = [0.19]\n"
    )
    entry = run_walk(tables_of(campaign)[0], 1)
    assert entry["state"] == "broken" and entry["reason"] and entry["strides"] == 0


def test_what_is_not_known_of_a_walk_is_null_in_the_results(tmp_path: Path) -> None:
    campaign, walked = loaded(tmp_path, SHORT), LogEntry("", "whole", "", 0, 0, walks=1, speed_m_s=0.1)
    entries = [values_of_entry(each) for each in (walked, walked._replace(state="broken", speed_m_s=None))]
    rows = [{"point": 1, "seed": n, "values": campaign.points[0]} | each for n, each in enumerate(entries, 1)]
    campaign_module._write(campaign, DataFrame(rows), tmp_path / TRIALS)
    found = Catalogue(tmp_path).query("select avg(speed_m_s), count(speed_m_s), sum(walks) from trials")
    assert found.rows == [(0.1, 1, 2)]
