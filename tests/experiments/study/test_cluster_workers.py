"""Trials on a Dask cluster of real processes: the same digits, lost workers, and clusters that cannot be used."""

import gc
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from experiments.study.notebook import Entry
from experiments.study.provenance import PACKAGES
from experiments.study.workers import WorkersError, run_locally, run_parallel
from experiments.trackway.simulated_walk import walk_in_mud
from tests.folders import ROOT
from tests.waiting import LONGEST_S, wait_until

distributed = pytest.importorskip("distributed", reason="needs the extra cluster")

from experiments.study import cluster_workers  # noqa: E402 - it imports distributed
from experiments.study.cluster_workers import run_on_cluster  # noqa: E402

LOCAL = "127.0.0.1"


class Cluster:
    """Owns a Dask scheduler and its workers as processes of their own."""

    def __init__(self, folder: Path) -> None:
        self._file, self._log = folder / "scheduler.json", folder / "cluster.log"
        port = ("--host", LOCAL, "--port", "0", "--no-dashboard", "--no-show")
        self.scheduler = self._start("scheduler", *port, "--scheduler-file", str(self._file))
        self.workers: list[subprocess.Popen[bytes]] = []

    @property
    def address(self) -> str:
        wait_until(self._is_announced)
        return str(json.loads(self._file.read_bytes())["address"])

    def _is_announced(self) -> bool:
        return self._file.exists() and self._file.read_bytes().rstrip().endswith(b"}")

    def add_worker(self, environment: Mapping[str, str] = {}, folder: Path = ROOT) -> subprocess.Popen[bytes]:
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", LOCAL, "--memory-limit", "0")
        self.workers.append(self._start("worker", self.address, *options, environment=environment, folder=folder))
        return self.workers[-1]

    def wait_for_workers(self) -> None:
        with distributed.Client(self.address, timeout=LONGEST_S) as client:
            client.wait_for_workers(len(self.workers), timeout=LONGEST_S)

    def _start(
        self, role: str, *options: str, environment: Mapping[str, str] = {}, folder: Path = ROOT
    ) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{role}", *options]
        with self._log.open("ab") as log:
            return subprocess.Popen(command, cwd=folder, env=os.environ | environment, stdout=log, stderr=log)

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
        for process in (*self.workers, self.scheduler):
            process.wait()


@contextmanager
def running_cluster(folder: Path, workers: int = 0) -> Iterator[Cluster]:
    cluster = Cluster(folder)
    try:
        for _ in range(workers):
            cluster.add_worker()
        if workers:
            cluster.wait_for_workers()
        yield cluster
    finally:
        cluster.end()


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
