"""The pages show what the results say, and `make claims` notices drift, unusable files and interruptions."""

import json
import os
import signal
from pathlib import Path

import pytest

from verification.claims import __main__ as runner
from verification.claims.pages import fill, pages
from verification.claims.results import (
    Claim,
    claimed_figures,
    is_within,
    load_claims,
    load_result,
    load_results,
    picture_digests,
    result_path,
)

PAGE = "A walk makes <!--= {speed/cm_s:.1f} cm/s -->{}<!--/-->.\n"

# the repository


def test_every_page_shows_what_the_results_say() -> None:
    results = load_results()
    texts = {path: path.read_text(encoding="utf-8") for path in pages()}
    assert [str(path) for path, text in texts.items() if fill(text, results) != text] == []


def test_every_claim_has_the_result_of_its_command_and_meets_its_bounds() -> None:
    claims, results = load_claims(), load_results()
    assert claims.keys() == results.keys()
    for name, claim in claims.items():
        record = results[name]
        assert (record["command"], record["tolerances"]) == (claim.command, dict(claim.figures)), name
        assert runner.drifted(claim, record["figures"], record["figures"]) == []
        assert record["pictures"] == picture_digests(claim), name


# tolerances, paths and templates


def test_the_rows_of_a_list_are_named_by_what_they_say() -> None:
    output = {
        "rows": [{"mud": "48.5", "speed": "1 rad/s", "k": 1.0}, {"mud": "48.5", "speed": "stopped", "k": 2.0}],
        "points": [{"pa": 300.0, "k": 1.0}, {"pa": 400.0, "k": 2.0}],
        "ends": [7, 8],
        "m/s": 3.0,
    }
    claim = Claim("a", "", dict.fromkeys(("rows/*/k", "points/*/k", "ends/*", "m|s"), "exact"))
    assert claimed_figures(claim, output) == {
        "rows/48.5, 1 rad|s/k": 1.0,  # a slash in a name does not part its path
        "rows/48.5, stopped/k": 2.0,
        "points/300.0/k": 1.0,
        "points/400.0/k": 2.0,
        "ends/0": 7,
        "ends/1": 8,
        "m|s": 3.0,
    }


@pytest.mark.parametrize(
    ("tolerance", "within", "outside"),
    [
        ("exact", 10.0, 10.1),
        ("0.5", 10.5, 9.4),
        ("5 %", 9.5, 10.6),
        ("x 2", 5.0, 20.1),
        (">= 9", 30.0, 8.9),
        ("<= 11", 1.0, 11.1),
        ("0.5, >= 9.8", 9.8, 9.7),
        ("0.5", 10.5, None),
        ("<= 11", 1.0, None),
    ],
)
def test_a_figure_drifts_beyond_its_tolerance(tolerance: str, within: float, outside: float | None) -> None:
    assert is_within(10.0, within, tolerance)
    assert not is_within(10.0, outside, tolerance)


@pytest.mark.parametrize(
    ("template", "text"),
    [
        ("{a/x:.1f} cm", "2.0 cm"),
        ("{a/list/*/y:.0%} %", "5 to 97 %"),
        ("{a/list/0/y:.0%} % of {a/x}", "97 % of 2.0"),
        ("{a/none:.1f}", "–"),
        ("{a/list/*/z}", "7"),
        ("\n\n{for 0; 1} | $ | {a/list/$/y:.0%} |\n\n", "\n\n| 0 | 97 |\n| 1 | 5 |\n\n"),
    ],
)
def test_a_template_is_filled(template: str, text: str) -> None:
    figures = {"x": 2.0, "none": None, "list/0/y": 0.97, "list/1/y": 0.05, "list/0/z": 7, "list/1/z": 7}
    page = f"before <!--= {template} -->old<!--/--> after"
    results = {"a": {"figures": figures}}
    assert fill(page, results, markers=False) == f"before {text} after"
    assert fill(page, results) == page.replace("old", text)


def test_a_template_without_a_figure_is_refused() -> None:
    with pytest.raises(ValueError, match="b/x"):
        fill("<!--= {b/x} -->1<!--/-->", {})


# the command


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return a project with one page and two claims, `speed` and `depth`, both with a result."""
    rows = ""
    printed: dict[str, dict[str, float | str]] = {"speed": {"cm_s": 7.0}, "depth": {"cm": 3.0, "ends": "past the end"}}
    for name, figures in printed.items():
        measuring = f"open('{tmp_path}/runs', 'a').write('{name} '); print(open('{tmp_path}/{name}.txt').read())"
        (tmp_path / f"{name}.txt").write_text(json.dumps(figures | {"unclaimed": 1.0}))
        patterns = "\n".join(f'"{key}" = "0.5"' for key in figures)
        rows += f'[{name}]\ncommand = """python -IS -c "{measuring}" """\n[{name}.figures]\n{patterns}\n'
    folder = tmp_path / "verification" / "claims"
    folder.mkdir(parents=True)
    (folder / "claims.toml").write_text(rows)
    (tmp_path / "README.md").write_text(PAGE.replace("{}", "7.0 cm/s"))
    assert runner.main(["--rewrite"], tmp_path) == 0
    (tmp_path / "runs").unlink()
    return tmp_path


def measure_again(root: Path, **figures: float) -> None:
    """Change what the command `speed` prints, and forget what was measured."""
    (root / "speed.txt").write_text(json.dumps(figures))
    for kept in (root / "build" / "claims").glob("*/measured.json"):
        kept.unlink()


def test_what_repeats_within_its_tolerance_is_true_and_changes_nothing(root: Path) -> None:
    measure_again(root, cm_s=7.4)
    assert runner.main([], root) == 0
    assert load_result(result_path("speed", root))["figures"] == {"cm_s": 7.0}


def test_a_drifted_figure_fails_with_its_page_and_is_rewritten_on_request(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measure_again(root, cm_s=6.0)
    assert runner.main([], root) == 1
    shown = capsys.readouterr().out
    assert all(part in shown for part in ("README.md", "cm_s", "7.0", "6.0", "0.5"))
    assert (root / "README.md").read_text() == PAGE.replace("{}", "7.0 cm/s")
    assert runner.main(["speed", "--rewrite"], root) == 0
    assert (root / "README.md").read_text() == PAGE.replace("{}", "6.0 cm/s")
    assert runner.main([], root) == 0


def test_a_claimed_figure_that_is_no_longer_printed_is_a_problem(root: Path) -> None:
    measure_again(root, other=6.0)
    assert runner.main(["speed", "--rewrite"], root) == 1
    assert load_result(result_path("speed", root))["figures"] == {"cm_s": 7.0}


def test_an_unknown_name_lists_those_that_exist(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert runner.main(["sped"], root) == 2
    assert "speed, depth" in capsys.readouterr().err
    assert not (root / "runs").exists()


@pytest.mark.parametrize("change", [("7.0", "7.5"), ('"digest"', '"digits"'), ("{", "")])
def test_an_unusable_result_is_named_and_the_others_are_measured(
    root: Path, capsys: pytest.CaptureFixture[str], change: tuple[str, str]
) -> None:
    path = result_path("speed", root)
    path.write_text(text := path.read_text().replace(*change, 1))
    measure_again(root, cm_s=7.0)
    assert runner.main(["--rewrite"], root) == 1
    assert str(path) in capsys.readouterr().err
    assert path.read_text() == text
    assert (root / "runs").read_text() == "depth "


def test_an_interrupted_run_keeps_what_it_has_and_continues(root: Path) -> None:
    measure_again(root, cm_s=7.0)
    (root / "depth.txt").rename(root / "later.txt")
    os.mkfifo(root / "depth.txt")  # the command waits for it

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 1.0)
    assert runner.main([], root) == 130
    signal.signal(signal.SIGALRM, before)
    (root / "later.txt").rename(root / "depth.txt")
    assert runner.main([], root) == 0
    assert (root / "runs").read_text() == "speed depth depth "
