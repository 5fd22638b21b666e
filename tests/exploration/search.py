"""Breadth-first search over every state that the robot can reach; a broken promise comes with a shortest path."""

from collections import deque
from collections.abc import Iterator
from itertools import chain, combinations, product
from typing import NamedTuple

from control.faults import Clears, FaultKind
from control.modes import Mode
from tests.exploration.abstract_drives import Event, Obedience
from tests.exploration.abstract_robot import AbstractRobot
from tests.exploration.memory import Call, Memory, Operator, World
from tests.exploration.promises import (
    CallEdge,
    Debts,
    after_call,
    after_tick,
    at_tick,
    broken_by_call,
    broken_by_tick,
    is_home,
    is_quiet,
    tick_edge,
)

DISARM, CLEAR = Call(Operator.BEN, "disarm"), Call(Operator.BEN, "clear")
MODES_WITH_AN_END = (Mode.WALKING, Mode.STOPPING, Mode.DAMPING)
BENIGN = World(done=True)
MOST_TICKS_HOME = 20

Node = tuple[Memory, Debts]
Step = Call | World


class Scope(NamedTuple):
    """The events that may happen, in any order and any number of times."""

    calls: tuple[Call, ...]  # with disarm and clear
    faults: tuple[FaultKind, ...] = ()
    drives: bool = False  # one drive may do anything


class Broken(NamedTuple):
    promise: str
    path: list[Step]

    def __str__(self) -> str:
        return f"{self.promise}:\n  " + "\n  ".join(str(step) for step in self.path)


class Exploration:
    """Owns every state that was found, and where each one leads by disarm, clear and benign ticks."""

    def __init__(self, scope: Scope, robot: AbstractRobot) -> None:
        self.scope = scope
        self.ticks = self.calls = 0
        self.broken: Broken | None = None
        self.mode_changes: set[tuple[Mode, Mode]] = set()
        self._robot = robot
        start: Node = (Memory(), Debts())
        self._came_from: dict[Node, tuple[Node, Step] | None] = {start: None}
        self._waiting = deque([start])
        self._left: dict[tuple[Node, Step], Node] = {}

    @property
    def states(self) -> int:
        """The number of different states of the robot that were reached."""
        return len({memory for memory, _ in self._came_from})

    def run(self) -> Broken | None:
        """Visit every state, and return the first broken promise."""
        while self._waiting and not self.broken:
            node = self._waiting.popleft()
            for call in self.scope.calls:
                self._visit_call(node, call)
            for world in self._worlds(node[0]):
                self._visit_tick(node, world)
        return self.broken or self._first_stuck()

    def _worlds(self, memory: Memory) -> Iterator[World]:
        kinds = self.scope.faults
        subsets = chain.from_iterable(combinations(kinds, count) for count in range(len(kinds) + 1))
        ends = (True, False) if memory.moving or memory.mode in MODES_WITH_AN_END else (True,)
        if not self.scope.drives:
            yield from (World(faults, done) for faults, done in product(subsets, ends))
        else:
            yield from (World(*each) for each in product(subsets, ends, (True, False), Obedience, Event))

    def _visit_call(self, node: Node, call: Call) -> None:
        before, debts = node
        self._robot.restore(before)
        accepted = self._robot.call(call)
        edge = CallEdge(before, debts, call, accepted, self._robot.memory())
        self.calls += 1
        self._add(node, call, (edge.after, after_call(edge)), broken_by_call(edge))

    def _visit_tick(self, node: Node, world: World) -> None:
        before, debts = node
        self._robot.restore(before)
        self._robot.tick(world)
        edge = tick_edge(self._robot, before, at_tick(before, debts), self._robot.memory())
        self.ticks += 1
        if edge.after.mode is not before.mode:
            self.mode_changes.add((before.mode, edge.after.mode))
        self._add(node, world, (edge.after, after_tick(edge)), broken_by_tick(edge))

    def _add(self, node: Node, step: Step, after: Node, broken: list[str]) -> None:
        if after not in self._came_from:
            self._came_from[after] = node, step
            self._waiting.append(after)
        if step in (DISARM, CLEAR, BENIGN):
            self._left[node, step] = after
        if broken and not self.broken:
            self.broken = Broken("; ".join(broken), [*self._path(node), step])

    def _path(self, node: Node) -> list[Step]:
        came = self._came_from[node]
        return [] if came is None else [*self._path(came[0]), came[1]]

    # what must always be possible in the end

    def _first_stuck(self) -> Broken | None:
        for node in self._came_from:
            if not self._quiets_down(node):
                return Broken("without an operator torque goes off in the end", self._path(node))
            if not self._comes_home(node):
                return Broken("every state comes back to idle by disarm and clear", self._path(node))
        return None

    def _quiets_down(self, node: Node) -> bool:
        for _ in range(MOST_TICKS_HOME):
            if is_quiet(node[0]):
                return True
            node = self._left[node, BENIGN]
        return False

    def _comes_home(self, node: Node) -> bool:
        """Return whether an operator who disarms and clears can arm again; after a bug, whether at least the torque is
        off.
        """
        for _ in range(MOST_TICKS_HOME):
            memory, debts = node
            bug = any(kind.clears is Clears.BY_RESTART for kind in debts.uncleared)
            if is_home(memory) or (bug and is_quiet(memory)):
                return True
            for step in (DISARM, CLEAR, BENIGN):
                node = self._left[node, step]
        return False
