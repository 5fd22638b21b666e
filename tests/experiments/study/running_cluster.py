"""A Dask scheduler and its workers as processes of their own, for tests; they end with the context."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from distributed import Client

from tests.folders import ROOT
from tests.waiting import LONGEST_S, wait_until

LOCAL = "127.0.0.1"


class Cluster:
    """Owns the processes."""

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
        with Client(self.address, timeout=LONGEST_S) as client:
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
