"""A clock for tests that must not wait."""

from dataclasses import dataclass, field


@dataclass
class SyntheticClock:
    """A clock whose time advances only by `sleep`, or by a test that changes `now_s`."""

    now_s: float = 100.0
    oversleep_s: float = 0.0
    slept_s: list[float] = field(default_factory=list)

    def read(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        assert duration_s > 0.0
        self.slept_s.append(duration_s)
        self.now_s += max(duration_s + self.oversleep_s, 1e-6)
