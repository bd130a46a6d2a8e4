"""Clusters for tests, and workers that fail when a test asks for it."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

from distributed import Client, LocalCluster
from distributed.diagnostics.plugin import WorkerPlugin


@contextlib.contextmanager
def local(n_workers, set_as_default=True):
    """A client of a cluster of processes that listen on the loopback device only."""
    with LocalCluster(n_workers=n_workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", host="127.0.0.1") as cluster:
        with Client(cluster, set_as_default=set_as_default) as client:
            yield client


class Faults(WorkerPlugin):
    """Makes the tasks of canted fail as files in a folder say, and counts them there.

    kill        the next task kills its worker in its middle; the file is removed
    always      every task does
    slow-PID    tasks of this process start late
    """

    name = "faults"

    def __init__(self, folder):
        self.folder = Path(folder)

    def setup(self, worker):
        from canted.distributed.worker import TASKS

        self.start = time.monotonic()
        for name, task in TASKS.items():
            TASKS[name] = self.around(task)

    def around(self, task):
        def run(*arguments, **options):
            with open(self.folder / f"count-{os.getpid()}", "a") as file:
                file.write(".")
            if (self.folder / f"slow-{os.getpid()}").exists():
                time.sleep(0.2)
            if self.takes_kill() or (self.folder / "always").exists():
                # Not before Dask knows that the process has started: it would give up.
                delay = max(0.03, 1.0 - (time.monotonic() - self.start))
                threading.Timer(delay, os.kill, (os.getpid(), signal.SIGKILL)).start()
                while True:
                    task(*arguments, **options)
            return task(*arguments, **options)

        return run

    def takes_kill(self):
        try:
            (self.folder / "kill").unlink()
        except FileNotFoundError:
            return False
        return True

    def count(self, pid):
        """The tasks that a process has started."""
        path = self.folder / f"count-{pid}"
        return len(path.read_text()) if path.exists() else 0


def pids(client):
    """Addresses of workers and their processes."""
    return client.run(os.getpid)


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@contextlib.contextmanager
def process(*words, prefix=()):
    """A module of Python as a process of its own, which has ended afterwards, with all that it started."""
    started = subprocess.Popen([*prefix, sys.executable, "-m", *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        yield started
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(started.pid, signal.SIGKILL)
        started.wait()


def scheduler(host, port, prefix=()):
    return process("distributed.cli.dask_scheduler", "--host", host, "--port", str(port), "--no-dashboard", prefix=prefix)


def worker(host, address, prefix=()):
    words = ("distributed.cli.dask_worker", address, "--host", host, "--nthreads", "1", "--no-dashboard", "--death-timeout", "30")
    return process(*words, prefix=prefix)


def wait_until(what, is_true, seconds=60):
    end = time.monotonic() + seconds
    while not is_true():
        assert time.monotonic() < end, f"waited {seconds} seconds until {what}"
        time.sleep(0.05)
