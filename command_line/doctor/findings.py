"""One line of `mudskipper doctor`: the result of a check, its severity, and what to do."""

from enum import StrEnum
from typing import Any, NamedTuple

from firmware_host.operator.reports import check_item


class Level(StrEnum):
    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


class Finding(NamedTuple):
    id: str
    level: Level
    text: str
    fix: str = ""

    @property
    def as_check_item(self) -> dict[str, Any]:
        return check_item(self.id, self.level is not Level.FAIL, self.text, self.fix, warns=self.level is Level.WARN)


def ok(identity: str, text: str) -> Finding:
    return Finding(identity, Level.OK, text)


def warn(identity: str, text: str, fix: str) -> Finding:
    return Finding(identity, Level.WARN, text, fix)


def fail(identity: str, text: str, fix: str) -> Finding:
    return Finding(identity, Level.FAIL, text, fix)


def ok_if(condition: bool, identity: str, text: str, fix: str, otherwise: Level = Level.WARN) -> Finding:
    """Return an ok finding where the condition holds, or else one of the other level with its fix."""
    return ok(identity, text) if condition else Finding(identity, otherwise, text, fix)
