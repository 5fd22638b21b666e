"""Robots on simulated buses that tests share."""

from functools import partial
from pathlib import Path

import pytest

from tests.command_line.drives.bench_setup import Bench, MakeBench


@pytest.fixture
def make_bench(short_folder: Path, monkeypatch: pytest.MonkeyPatch) -> MakeBench:
    """Return a function that makes a robot in the working directory."""
    monkeypatch.chdir(short_folder)
    return partial(Bench, short_folder, monkeypatch)
