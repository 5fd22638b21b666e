"""Bounded work runs in its order and gives the same result however many units run at a time."""

import pytest

from control.computing.bounded_work import Work, WorkQueue, batched


def counting(log: list[str], name: str, units: int) -> Work[None]:
    for unit in range(units):
        log.append(f"{name}{unit}")
        if unit < units - 1:
            yield


@pytest.mark.parametrize("units", [1, 2, 3, 100])
def test_the_order_does_not_depend_on_the_units_at_a_time(units: int) -> None:
    log, queue = list[str](), WorkQueue()
    for name, count in (("a", 3), ("b", 1), ("c", 2)):
        queue.add(counting(log, name, count))
    while not queue.is_empty:
        queue.run(units)
    assert log == ["a0", "a1", "a2", "b0", "c0", "c1"]


def test_a_run_takes_no_more_units_than_allowed() -> None:
    log, queue = list[str](), WorkQueue()
    queue.add(counting(log, "a", 2))
    queue.add(counting(log, "b", 2))
    sizes = []
    for _ in range(5):
        queue.run(1)
        sizes.append(len(log))
    assert sizes == [1, 2, 3, 4, 4]
    assert queue.is_empty


def test_cleared_work_never_runs() -> None:
    log, queue = list[str](), WorkQueue()
    queue.add(counting(log, "a", 3))
    queue.run(1)
    queue.clear()
    queue.finish()
    assert log == ["a0"]


@pytest.mark.parametrize("size", [1, 2, 3, 7])
def test_batches_have_all_values_in_order(size: int) -> None:
    batches = list(batched(range(7), size))
    assert [value for batch in batches for value in batch] == list(range(7))
    assert all(len(batch) == size for batch in batches[:-1])
