"""`mudskipper experiment` on rows of parameters: what is refused before any work."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import exit_codes
from command_line.main import main
from tests.command_line.command_lines import failure, refusal


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results without --out go to a folder of the test."""
    monkeypatch.chdir(tmp_path)


def test_a_real_trackway_needs_a_daemon(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    status = main(["experiment", "trackway", "--socket", str(tmp_path / "none"), "--out", str(tmp_path)])
    assert status == exit_codes.NO_DAEMON
    assert "no daemon answers" in capsys.readouterr().err


REFUSED = {
    "trackway --method paper": "--method can only be given with --simulated",
    "trackway --mud soft --mud soft": "--mud",
    "trackway --workers 2": "can only be given with --simulated",
    "trackway --cluster tcp://127.0.0.1:8786": "can only be given with --simulated",
    "sweep --simulated --workers 0": "--workers",
    "sweep --simulated --workers 2 --cluster tcp://127.0.0.1:8786": "--workers",
    "trackway --compartment 0.5": "--compartment can only be given with --simulated",
    "trackway --simulated --mud 48.5": "--mud can only be given without --simulated",
    "trackway --mud 48.5=5": "from 20 to 10000 cm",
    "sweep": "--simulated",
    "mud-fit": "--simulated",
    "trackway --simulated --method paper --method fog": "'fog'",
    "sweep --simulated --method paper --method fog": "'fog'",
    "trackway --simulated --seeds 0": "--seeds",
    "trackway --simulated --compartment 0.1": "--compartment",
    "trackway --simulated --compartment nan": "--compartment",
    "sweep --simulated --strength 49": "--strength",
    "sweep --simulated --strength firm": "--strength",
    "mud-fit --simulated --seeds 1001": "--seeds",
}


def test_a_wrong_option_is_refused_by_name_or_range(capsys: pytest.CaptureFixture[str]) -> None:
    for options, message in REFUSED.items():
        assert message in refusal(capsys, "experiment", *options.split()), options


@pytest.mark.parametrize("name", ["trackway", "mud-fit"])
def test_an_impossible_output_folder_is_refused_before_the_work(
    name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    assert "must be a folder" in refusal(capsys, "experiment", name, "--simulated", "--out", str(tmp_path / "file"))
    below = str(tmp_path / "file" / "below")
    assert "file/below: Not a directory" in failure(capsys, "experiment", name, "--simulated", "--out", below)
