"""Schedules that broke a promise once, shrunk to what mattered, each with a sentence about what was wrong.

They are kept as they were printed and not as seeds alone, because a seed draws another schedule when drawing changes.
"""

from __future__ import annotations

from typing import NamedTuple

from tests.dst.scenario import Scenario


class Regression(NamedTuple):
    sentence: str
    scenario: Scenario


REGRESSIONS: tuple[Regression, ...] = ()
