"""Fixtures that tests of several layers share."""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from firmware_host.configuration import Configuration, load_configuration

# A busy machine is not wrong, and a commit gets the same verdict every time; `--hypothesis-profile search` looks on.
settings.register_profile("search", deadline=None)
settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")

signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job starts with it ignored, and so its children

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def example_text() -> str:
    """The configuration that the README tells a robot's owner to start from."""
    return (ROOT / "systemd" / "mudskipper.toml").read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def configuration() -> Configuration:
    return load_configuration(ROOT / "systemd" / "mudskipper.toml")


@pytest.fixture
def short_folder() -> Iterator[Path]:
    """A folder whose path leaves room for the name of a Unix socket."""
    with tempfile.TemporaryDirectory(prefix="mud-") as folder:
        yield Path(folder)
