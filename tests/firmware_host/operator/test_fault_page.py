"""The page about faults says what the robot does."""

from control.faults import FAULT_KINDS
from control.modes import TRANSITIONS, Mode
from firmware_host.operator.fault_page import fault_page
from tests.folders import ROOT

PAGE = ROOT / "docs" / "faults.md"


def test_the_page_is_written_from_the_tables() -> None:
    """Where it is not: python -m firmware_host.operator.fault_page > docs/faults.md"""
    assert PAGE.read_text(encoding="utf-8") == fault_page()


def test_the_page_shows_every_fault_every_mode_and_every_transition() -> None:
    page = fault_page()
    assert all(f"`{name}`" in page for name in FAULT_KINDS)
    for row in TRANSITIONS:
        for source in row.sources - {row.target}:
            arrow = next(
                line for line in page.splitlines() if line.startswith(f"    {source.name} --> {row.target.name} ")
            )
            assert row.cause.text in arrow
    assert all(mode.name in page for mode in Mode)
