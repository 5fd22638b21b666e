"""Trials on a Dask cluster of real processes: the same digits, lost workers, and clusters that cannot be used."""

import gc
import shutil
from functools import partial
from pathlib import Path

import pytest

from experiments.study.notebook import Entry
from experiments.study.provenance import PACKAGES
from experiments.study.workers import WorkersError, run_locally, run_parallel
from experiments.trackway.simulated_walk import walk_in_mud
from tests.folders import ROOT

pytest.importorskip("distributed", reason="needs the extra cluster")

from experiments.study import cluster_workers  # noqa: E402 - it imports distributed
from experiments.study.cluster_workers import run_on_cluster  # noqa: E402
from tests.experiments.study.running_cluster import running_cluster  # noqa: E402

WALKS = [partial(walk_in_mud, 2800.0, seed, 0.02, count=1) for seed in range(1, 4)]


@pytest.fixture(autouse=True)
def closed_clients() -> None:
    """Closes the clients of earlier tests that found no cluster.

    Otherwise the garbage collector may close one in the thread of the next client's event loop, which then waits for
    itself.
    """
    gc.collect()


@pytest.fixture(scope="module")
def digits() -> list[Entry]:
    return run_parallel(WALKS, ignore, partial(run_locally, processes=1))


def ignore(done: int, total: int) -> None:
    pass


def test_a_cluster_finds_the_digits_of_one_worker_although_a_worker_is_killed_and_its_loss_is_one_message(
    tmp_path: Path, digits: list[Entry]
) -> None:
    shown: list[tuple[int, int]] = []
    kept: list[Entry] = []
    with running_cluster(tmp_path, workers=2) as cluster:

        def kill_one_after_the_first(index: int, walk: Entry) -> None:
            if shown[-1][0] == 0:
                cluster.workers[0].kill()

        workers = partial(run_on_cluster, address=cluster.address)
        assert run_parallel(WALKS, lambda *count: shown.append(count), workers, kill_one_after_the_first) == digits
        assert shown == [(done, len(WALKS)) for done in range(len(WALKS) + 1)]

        def lose(index: int, walk: Entry) -> None:
            kept.append(walk)
            cluster.end()

        with pytest.raises(WorkersError, match=f"the cluster at {cluster.address} was lost"):
            run_parallel(WALKS, ignore, workers, lose)
    assert kept == digits[: len(kept)]


def test_a_cluster_that_cannot_be_reached_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_workers, "CONNECT_S", 0.5)
    for address in ("tcp://127.0.0.1:1", "127.0.0.1:1", "fog://127.0.0.1:1", "nowhere"):
        with pytest.raises(WorkersError, match=f"no cluster answers at {address}"):
            run_parallel(WALKS, ignore, partial(run_on_cluster, address=address))


def test_a_cluster_without_workers_of_these_sources_is_refused_before_the_first_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other"
    for folder in PACKAGES:
        shutil.copytree(ROOT / folder, other / folder, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "simulation" / "mud" / "clay.py").open("a", encoding="utf-8") as module:
        module.write("MUDS = {}\n")
    with running_cluster(tmp_path) as cluster:
        monkeypatch.setattr(cluster_workers, "CONNECT_S", 1.0)
        with pytest.raises(WorkersError, match="has no workers: start some with 'dask worker tcp://"):
            run_parallel(WALKS, ignore, partial(run_on_cluster, address=cluster.address))
        monkeypatch.undo()
        cluster.add_worker({"PYTHONPATH": str(other)}, other)
        cluster.wait_for_workers()
        with pytest.raises(WorkersError, match="install the same version of mudskipper on all workers") as refused:
            run_parallel(WALKS, ignore, partial(run_on_cluster, address=cluster.address))
    assert str(refused.value).count("sources") == 2
