"""Folders that tests read: the repository, and the authors' measurements if they are available."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHARED_DATA = Path(os.environ.get("MUDSKIPPER_SHARED_DATA", ROOT.parent / "shared" / "data"))
EXAMPLE_CONFIGURATION = ROOT / "systemd" / "mudskipper.toml"
EXAMPLE_WORLD = ROOT / "simulation" / "harness" / "example_world.toml"
