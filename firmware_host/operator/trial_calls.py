"""The methods of the status socket that describe a walk: its trial, notes and markers.

Defaults hold until they are changed, also after a restart of the daemon (firmware_host/trial.py). A walk with a
description begins a trial, and so does one without it after a trial, since the trial's log must not go on.
"""

from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any

from firmware_host.loop_events import LoopEvents
from firmware_host.sockets.connection import Caller
from firmware_host.sockets.rpc import RefusedError
from firmware_host.trial import BEGUN, KEYS, MARKER, NOTE, SET, OperatorReport, Trial, changed, to_json


class TrialCalls:
    """Owns the defaults, and the description of the present trial."""

    def __init__(
        self,
        events: LoopEvents,
        clock: Callable[[], float],
        wall_clock: Callable[[], float],
        defaults: Mapping[str, str],
    ) -> None:
        self.present: Trial = {}
        self._events, self._clock, self._wall_clock, self._defaults = events, clock, wall_clock, dict(defaults)

    def trial(self, params: dict[str, Any], caller: Caller) -> dict[str, Trial]:
        return {"defaults": self._defaults, "present": self.present}

    def trial_set(self, params: dict[str, Any], caller: Caller) -> dict[str, Trial]:
        self._defaults = _changed(self._defaults, params)
        self._report(SET, to_json(self._defaults), caller)
        return self.trial({}, caller)

    def planned(self, params: Mapping[str, Any]) -> Trial:
        """Return the trial of a walk with these parameters. Raises RefusedError."""
        return _changed(self._defaults, {key: params[key] for key in KEYS})

    def begin(self, trial: Trial, caller: Caller) -> None:
        """Begin a trial, and so a new log, unless neither this walk nor the one before is described."""
        if trial or self.present:
            self.present = trial
            self._report(BEGUN, to_json(trial), caller)

    def note(self, params: dict[str, Any], caller: Caller) -> dict[str, Any]:
        return self._report(NOTE, params["text"], caller)

    def mark(self, params: dict[str, Any], caller: Caller) -> dict[str, Any]:
        return self._report(MARKER, params["text"], caller)

    def _report(self, kind: str, text: str, caller: Caller) -> dict[str, Any]:
        stamp_s, time = self._clock(), datetime.fromtimestamp(self._wall_clock(), UTC)
        self._events.report(stamp_s, OperatorReport(kind, time, str(caller), text).event)
        return {"stamp_s": stamp_s, "time": time.isoformat(timespec="microseconds")}


def _changed(trial: Trial, changes: Mapping[str, Any]) -> Trial:
    try:
        return changed(trial, {key: value for key, value in changes.items() if value is not None})
    except ValueError as problem:
        raise RefusedError(str(problem)) from None
