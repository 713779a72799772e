"""A Dask cluster on the loopback address, whose processes tests start and end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

Process = subprocess.Popen[bytes]


class Cluster:
    """A scheduler, and workers that are one process each: nothing starts them again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.workers: list[Process] = []
        self._all: list[Process] = []
        self.start_scheduler()

    def start_scheduler(self) -> None:
        self.scheduler = self._start("scheduler", "--port", str(self.port))
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", self.port)) == 0:
                    return
            time.sleep(0.05)
        raise TimeoutError(self.address)

    def start_worker(self, *more: str, prefix: tuple[str, ...] = ()) -> Process:
        where = self.folder / f"worker{len(self._all)}"
        given = ("--nthreads", "1", "--no-nanny", "--local-directory", str(where), *more)
        self.workers.append(self._start("worker", self.address, *given, prefix=prefix))
        return self.workers[-1]

    def _start(self, kind: str, *arguments: str, prefix: tuple[str, ...] = ()) -> Process:
        log = (self.folder / f"{kind}{len(self._all)}.log").open("wb")
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments]
        host = () if "--host" in arguments else ("--host", "127.0.0.1")
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        environment["DASK_DISTRIBUTED__WORKER__DAEMON"] = "False"
        process = subprocess.Popen(
            [*prefix, *command, *host, "--no-dashboard"],
            stdout=log,
            stderr=log,
            env=environment,
        )
        log.close()
        self._all.append(process)
        return process

    def end(self, process: Process, how: signal.Signals = signal.SIGKILL) -> None:
        process.send_signal(how)
        process.wait(30)

    def close(self) -> None:
        for process in reversed(self._all):
            if process.poll() is None:
                process.kill()
        for process in self._all:
            process.wait(30)


@contextmanager
def open_cluster(folder: Path, workers: int = 2) -> Iterator[Cluster]:
    cluster = Cluster(folder)
    try:
        for _ in range(workers):
            cluster.start_worker()
        yield cluster
    finally:
        cluster.close()
