"""A recorder that keeps the sentences of a log, for tests that look at what was told."""

from __future__ import annotations

from firmware_host.log.recorder import NullRecorder
from firmware_host.log.rows import EVENT, EVENT_KIND


class EventRecorder(NullRecorder):
    def __init__(self) -> None:
        self.kinds: list[int] = []  # of all rows
        self.texts: list[str] = []

    def put(self, kind_index: int, payload: bytes) -> bool:
        self.kinds.append(kind_index)
        if kind_index == EVENT_KIND:
            self.texts.append(EVENT.decode(payload)["text"])
        return True

    def about(self, word: str) -> list[str]:
        return [text for text in self.texts if word in text]
