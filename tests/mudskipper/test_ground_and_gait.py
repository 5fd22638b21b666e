"""A ground and a gait are checked as their files are, and nothing changes them."""

import doctest
import tomllib
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mudskipper import ConfigurationError, Gait, Ground, ground_and_gait
from simulation.harness.world import load_world, read_world
from tests.folders import ROOT

WORLD = ROOT / "simulation/harness/example_world.toml"
ELLIPSE = ROOT / "firmware_host/configuration/gaits/ellipse.toml"


def test_the_examples_of_the_documentation_run() -> None:
    results = doctest.testmod(ground_and_gait)
    assert results.attempted and not results.failed


def test_a_file_and_its_keys_as_keywords_are_the_same_value() -> None:
    assert Ground(WORLD) == Ground(**tomllib.loads(WORLD.read_text(encoding="utf-8")))
    assert read_world(Ground(WORLD).tables).disturbances == load_world(WORLD).disturbances
    assert Gait("ellipse") == Gait(ELLIPSE) and hash(Gait("ellipse")) == hash(Gait(ELLIPSE))


def test_keywords_count_more_than_the_file_and_none_leaves_a_key_out() -> None:
    changed = Gait("ellipse", depths_m=(0.02, 0.03)).tables
    assert changed == Gait("ellipse").tables | {"depths_m": [0.02, 0.03]}
    assert changed == Gait("ellipse", depths_m=np.array([0.02, 0.03])).tables
    level = Ground(WORLD, ridges=None).tables
    assert "ridges" not in level and level["stone"] == Ground(WORLD).tables["stone"]
    firm = Ground(WORLD, segment=None, strength_pa=2500.0).tables
    assert len(firm["segment"]) == 1 and firm["disturbances"] == Ground(WORLD).tables["disturbances"]
    assert Ground(sand="generic", strength_pa=None).tables["segment"][0].keys() == {"start_m", "end_m", "sand"}


def test_nothing_changes_them() -> None:
    ground = Ground(strength_pa=800.0)
    with pytest.raises(FrozenInstanceError):
        ground.text = "{}"  # type: ignore[misc]
    ground.tables["segment"].clear()
    assert ground == Ground(strength_pa=800.0)


@pytest.mark.parametrize(
    ("kind", "tables", "named"),
    [
        (Ground, {"strength_pa": np.nan}, "strength_pa"),
        (Ground, {"strength_pa": 800.0, "sand": "generic"}, "strength_pa"),
        (Ground, {"strength_pa": 800.0, "segment": []}, "segment"),
        (Ground, {"segment": [{"start_m": 1.0, "end_m": 2.0, "sand": "generic"}]}, "start_m"),
        (Ground, {"robot": {"body_mass": 1.0}}, "body_mass_kg"),
        (Gait, {"depths_m": [0.02]}, "phase"),
        (Gait, {"phase": [{"name": "swing", "duration_s": 0.5}] * 2, "name": "mine"}, "mine: phase = swing"),
        (Gait, {"phase": [{"name": "run"}]}, "run"),
    ],
)
def test_what_no_file_may_say_is_refused_with_the_key(kind: type, tables: dict[str, Any], named: str) -> None:
    with pytest.raises(ConfigurationError, match=named):
        kind(**tables)


@pytest.mark.parametrize("kind", [Ground, Gait])
def test_a_file_that_is_missing_is_named(kind: type, tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="none.toml"):
        kind(tmp_path / "none.toml")
