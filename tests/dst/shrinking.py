"""Shrinks a scenario that breaks a promise to a short one that breaks the same promise.

Delta debugging: events are left out in smaller and smaller groups, then durations and the whole run become shorter, and
the surroundings return to the defaults, as long as the promise stays broken.
"""

from collections.abc import Callable, Iterator

from tests.dst.scenario import LASTING, Event, Scenario, Surroundings, end_s

SHORTEST_S = 0.01
AFTER_S = 0.05  # of the run, after its last event

Breaks = Callable[[Scenario], bool]


def shrink(scenario: Scenario, breaks: Breaks, most_runs: int = 150) -> Scenario:
    """Return the smallest scenario found that `breaks` accepts. The given one must be accepted."""
    runs = 0
    progress = True
    while progress:
        progress = False
        for smaller in _smaller(scenario):
            if runs >= most_runs:
                return scenario
            runs += 1
            if breaks(smaller):
                scenario, progress = smaller, True
                break
    return scenario


def _smaller(scenario: Scenario) -> Iterator[Scenario]:
    """Yield simpler scenarios, those that would save most first."""
    for events in _with_fewer(scenario.events):
        yield scenario._replace(events=events)
    for shorter in _with_shorter(scenario.events):
        yield scenario._replace(events=shorter)
    soonest_s = max((end_s(event) for event in scenario.events), default=0.0) + AFTER_S
    for for_s in (soonest_s, (soonest_s + scenario.for_s) / 2.0):
        if for_s < scenario.for_s - SHORTEST_S:
            yield scenario._replace(for_s=round(for_s, 3))
    for name, default in Surroundings()._asdict().items():
        if getattr(scenario.surroundings, name) != default:
            yield scenario._replace(surroundings=scenario.surroundings._replace(**{name: default}))


def _with_fewer(events: tuple[Event, ...]) -> Iterator[tuple[Event, ...]]:
    size = len(events)
    while size:
        for start in range(0, len(events), size):
            yield events[:start] + events[start + size :]
        size //= 2


def _with_shorter(events: tuple[Event, ...]) -> Iterator[tuple[Event, ...]]:
    for index, event in enumerate(events):
        if isinstance(event, LASTING) and event.for_s > 2.0 * SHORTEST_S:
            yield (*events[:index], event._replace(for_s=round(event.for_s / 2.0, 3)), *events[index + 1 :])
