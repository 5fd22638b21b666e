"""A recorder that stores the event texts of a log, for tests of reported events."""

from firmware_host.log.recorder import NullRecorder, Recording
from firmware_host.log.rows import EVENT, EVENT_KIND


class EventRecorder(NullRecorder):
    """Records event texts and passes every row on to `log`, if there is one."""

    def __init__(self, log: Recording | None = None) -> None:
        self.kinds: list[int] = []  # of all rows
        self.texts: list[str] = []
        self.log = log or NullRecorder()

    def put(self, kind_index: int, payload: bytes) -> bool:
        self.kinds.append(kind_index)
        if kind_index == EVENT_KIND:
            self.texts.append(EVENT.decode(payload)["text"])
        return self.log.put(kind_index, payload)

    def about(self, word: str) -> list[str]:
        return [text for text in self.texts if word in text]
