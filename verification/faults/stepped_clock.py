"""An injector that steps the wall clock with which the kernel stamps the frames of a bus."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from drivers.can.frames import Frame
from drivers.can.stamp_clock import StampClock
from verification.faults.bench import FaultBench
from verification.faults.injectors import Injector

ARRIVED_BEFORE_S = 0.0005  # a read


class KernelStamps:
    """Stamps the frames of a port with a wall clock, as the kernel does, and converts the stamps back."""

    def __init__(self, bench: FaultBench, receive: Callable[[], Sequence[Frame]], step_s: float) -> None:
        self._bench = bench
        self._receive = receive
        self._step_s = step_s
        self._since_s = bench.now_s + bench.period_s - ARRIVED_BEFORE_S / 2.0  # after the frames of the next read
        self._clock = StampClock(lambda: bench.now_s, lambda: self._wall_s(bench.now_s))

    def _wall_s(self, time_s: float) -> float:
        return time_s + (self._step_s if time_s > self._since_s else 0.0)

    def receive(self) -> list[Frame]:
        offset_s = self._clock.offset_s()
        stamp_s = self._wall_s(self._bench.now_s - ARRIVED_BEFORE_S) + offset_s
        return [frame._replace(stamp_s=stamp_s) for frame in self._receive()]


def wall_clock_stepped(step_s: float) -> Injector:
    @contextmanager
    def inject(bench: FaultBench, joint: str) -> Iterator[None]:
        ports = bench.loop.drives.ports.values()
        for port in ports:
            vars(port)["receive"] = KernelStamps(bench, port.receive, step_s).receive
        yield
        for port in ports:
            del vars(port)["receive"]

    return inject
