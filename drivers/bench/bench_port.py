"""Asks drives one question after the other and waits for their answers: for the bench, never for the loop.

Nothing here may command torque. Each protocol's bench.py makes the questions; the tests check that the daemon's own
transmit gate, closed, would let each question of a search pass.
"""

import time
from collections.abc import Callable, Iterable

from drivers.can.can_port import CanPort
from drivers.can.frames import Frame

POLL_S = 0.002
PACE_S = 0.001  # between two questions to different drives: a transmit queue of Linux has room for ten frames
ANSWER_S = 0.3  # a simulated drive on a busy computer answers late


class NoAnswerError(Exception):
    """A drive did not answer, or answered something else; the message says what was asked."""


class BenchPort:
    """One bus. `now` and `sleep` are the clock, which a test replaces by simulated time."""

    def __init__(
        self, port: CanPort, now: Callable[[], float] = time.monotonic, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        self._port = port
        self._now = now
        self._sleep = sleep

    @property
    def now_s(self) -> float:
        return self._now()

    @property
    def error_frames(self) -> int:
        return self._port.error_frames

    @property
    def send_problem(self) -> str:
        """Return why frames did not leave; empty while all did."""
        return self._port.last_send_error if self._port.failed_sends else ""

    def sleep(self, duration_s: float) -> None:
        self._sleep(duration_s)

    def listen(self, duration_s: float) -> list[Frame]:
        """Return all frames of that time."""
        return self._receive(lambda frames: False, duration_s)

    def send(self, frame: Frame) -> None:
        self._port.send(frame)

    def ask(self, question: Frame, is_answer: Callable[[Frame], bool], what: str, longest_s: float = ANSWER_S) -> Frame:
        """Return the first answer. Raises NoAnswerError, which names `what` was asked for."""
        self._port.receive()  # older frames are no answers
        self._port.send(question)
        frames = self._receive(lambda frames: any(map(is_answer, frames)), longest_s)
        for frame in frames:
            if is_answer(frame):
                return frame
        raise NoAnswerError(f"no answer to {what}" + (f" ({self.send_problem})" if self.send_problem else ""))

    def ask_all(self, questions: Iterable[Frame]) -> list[Frame]:
        """Return all frames that arrive from the first question until ANSWER_S after the last one."""
        frames = list(self._port.receive())
        for question in questions:
            self._port.send(question)
            frames += self.listen(PACE_S)
        return frames + self.listen(ANSWER_S)

    def _receive(self, done: Callable[[list[Frame]], bool], longest_s: float) -> list[Frame]:
        """Return the frames that arrive until `done` with them, or for `longest_s`."""
        deadline_s = self._now() + longest_s
        frames = [frame for frame in self._port.receive() if not frame.is_error]
        while not done(frames) and (left_s := deadline_s - self._now()) > 0.0:
            self._sleep(min(POLL_S, left_s))
            frames += [frame for frame in self._port.receive() if not frame.is_error]
        return frames
