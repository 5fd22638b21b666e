"""Fixtures for the tests of the daemon."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.firmware_host.sockets.served_socket import Served


@pytest.fixture
def served(short_folder: Path) -> Iterator[Served]:
    status = Served(short_folder / "s")
    yield status
    status.close()
