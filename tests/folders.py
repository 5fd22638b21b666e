"""Folders that tests read: the repository, and measurements that no one here made, where they are at hand."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHARED_DATA = Path(os.environ.get("MUDSKIPPER_SHARED_DATA", ROOT.parent / "shared" / "data"))
EXAMPLE_CONFIGURATION = ROOT / "systemd" / "mudskipper.toml"
EXAMPLE_WORLD = ROOT / "simulation" / "harness" / "example_world.toml"
