"""Explore everything at once, which takes an hour: `python -m tests.exploration`. The tests explore a part of it."""

import sys

from tests.exploration.abstract_robot import AbstractRobot
from tests.exploration.scopes import all_scopes
from tests.exploration.search import Exploration


def main() -> int:
    robot, states, broken_scopes = AbstractRobot(), 0, 0
    for scope in all_scopes():
        exploration = Exploration(scope, robot)
        broken = exploration.run()
        states += exploration.states
        broken_scopes += broken is not None
        faults = " and ".join(kind.value for kind in scope.faults)
        drive = ", a drive that does anything" if scope.drives else ""
        print(f"{faults}{drive}: {exploration.states} states, {exploration.ticks} ticks, {exploration.calls} calls")
        print(broken or "every promise is kept", flush=True)
    print(f"{states} states in all")
    return 1 if broken_scopes else 0


if __name__ == "__main__":
    sys.exit(main())
