"""The steps of an experiment with an operator, one after the other.

A step asks the operator to prepare something, measures, and returns an entry of the notebook, which is on the disk
before the next step begins. A step whose entry is there already is not asked for again, so the same command continues
an interrupted experiment.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from experiments.study.notebook import Entry, Notebook
from experiments.study.prompt import GO_ON, REDO, SKIP, Operator
from experiments.study.session import Show


class OperatorStep(NamedTuple):
    key: str  # of its entry
    prepare: Callable[[], str | None]  # returns GO_ON, SKIP to leave it out, REDO for the one before, None to repeat
    measure: Callable[[], Entry | None]  # returns nothing to prepare it again


def conduct_steps(
    steps: Sequence[OperatorStep], notebook: Notebook, operator: Operator, show: Show, skipped: Entry
) -> None:
    """Take every step that is not in the notebook. `skipped` is the entry of one that the operator leaves out."""
    index = 0
    while index < len(steps):
        step = steps[index]
        if step.key in notebook.entries:
            index += 1
            continue
        show(index, len(steps))
        answer = step.prepare()
        if answer == REDO and index == 0:
            operator.report("nothing was measured before this one")
        elif answer == REDO:
            index -= 1
            notebook.forget(steps[index].key)
        elif answer == SKIP:
            notebook.write(step.key, skipped)
        elif answer == GO_ON and (entry := step.measure()) is not None:
            notebook.write(step.key, entry)
    show(len(steps), len(steps))
