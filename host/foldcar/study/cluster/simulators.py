"""Simulators for `--scheduler`: chunks run on the workers of a Dask scheduler.

If a worker dies, Dask retries its chunk on another one. A chunk that kills several workers is halved until the guilty
run is alone; that run then counts as failed. Security is Dask's: tls:// addresses take keys and certificates from its
configuration (distributed.comm.tls); a local cluster creates temporary ones.
"""

import contextlib
import importlib.metadata
import logging
import math
import re
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.installation import require, usable_processors
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import Runner, RunRequest
from foldcar.study.cluster.chunk import Recipe, fault_of_worker, recipe_of, run_chunk
from foldcar.study.limits import MAX_JOBS
from foldcar.version import __version__

LOCAL = "local"
CONNECT_S = 10
POLL_S = 1.0
# How long a sweep waits for a worker; Dask's configuration key `foldcar.wait` overrides it.
WAIT = "10 minutes"
# Retries of a chunk for which a worker raises an error.
RETRIES = 2
# Number of characters of Dask's own message that an error shows.
MAX_REASON = 200
# HOST:PORT, or with a protocol such as tcp:// before it.
PROTOCOL = r"([a-z]+://)?"
# A host is an IPv6 address in brackets, a name, or an IPv4 address.
HOST = r"(\[[0-9a-fA-F:.%\w]+\]|[^\s:/\[\]]+)"
ADDRESS = re.compile(f"{PROTOCOL}{HOST}:[0-9]{{1,5}}")


def check_scheduler(scheduler: str | None, jobs: int | None) -> None:
    """Raise FoldcarError if ``scheduler`` is neither ``local`` nor an address, or is used with ``--jobs``."""
    if scheduler is None:
        return
    if jobs is not None:
        raise FoldcarError("--jobs: has no effect with --scheduler, whose workers simulate; local:N starts N workers")
    _local_workers(scheduler)


def _local_workers(scheduler: str) -> int | None:
    """Return the number of workers to start on this machine; None for an address."""
    if scheduler == LOCAL:
        return usable_processors()
    protocol_or_host, _, number = scheduler.partition(":")
    if protocol_or_host == LOCAL:
        if re.fullmatch(r"[0-9]{1,9}", number) and 1 <= int(number) <= MAX_JOBS:
            return int(number)
        raise FoldcarError(f"--scheduler: {scheduler}: is not local:N with N from 1 to {MAX_JOBS}")
    if not ADDRESS.fullmatch(scheduler):
        raise FoldcarError(f"--scheduler: '{scheduler}' is neither local nor an address such as tcp://10.0.0.1:8786")
    return None


@contextlib.contextmanager
def open_cluster(scheduler: str, carsim: Carsim, print_line: Callable[[str], None]) -> Iterator["ClusterSimulators"]:
    """Yield simulators at ``scheduler``: an address such as tcp://host:8786, ``local``, or ``local:N`` with N workers.

    ``print_line`` is called with a line if workers are missing or cannot run the sweep. Raises FoldcarError.
    """
    local_workers = _local_workers(scheduler)
    require("cluster")
    import dask
    import distributed

    # Hide Dask's messages, which are for administrators of clusters.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    warnings.filterwarnings("ignore", module="distributed")
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="foldcar-", ignore_cleanup_errors=True))
        stack.enter_context(dask.config.set({"temporary-directory": folder}))
        # Dask takes an address or a cluster object.
        address: Any = scheduler
        if local_workers is not None:
            address = stack.enter_context(_local_cluster(local_workers))
        try:
            client = stack.enter_context(distributed.Client(address, timeout=CONNECT_S, set_as_default=False))
            version = client.get_versions()["scheduler"]["packages"]["distributed"]
        except Exception as error:
            reason = " ".join(str(error).split())[:MAX_REASON] or type(error).__name__
            raise FoldcarError(f"--scheduler: {scheduler}: no Dask scheduler answers there: {reason}") from None
        own_version = distributed.__version__
        if version != own_version:
            raise FoldcarError(
                f"--scheduler: {scheduler}: runs distributed {version}, here is {own_version}: install the same"
            )
        yield ClusterSimulators(client, carsim, print_line)


def _local_cluster(workers: int) -> Any:
    """Start a Dask scheduler and workers with one thread each on this machine. Return it as a context manager."""
    import distributed

    with _ignoring_ctrl_c():
        return distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, security=distributed.Security.temporary(), memory_limit=0,
            dashboard_address=None, worker_dashboard_address=None, silence_logs=logging.CRITICAL,
        )  # fmt: skip


@contextlib.contextmanager
def _ignoring_ctrl_c() -> Iterator[None]:
    """Make processes that the block starts ignore Ctrl-C: the command handles it and ends them."""
    # Python sets signal handlers only in the main thread.
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


class ClusterSimulators:
    """Simulators (foldcar.study.chunks) on the workers of ``client``; ``carsim`` is the sweep's."""

    chunk_s = 2.5
    # Maximum number of threads on this machine that wait for chunks.
    max_count = 1024

    def __init__(self, client: Any, carsim: Carsim, print_line: Callable[[str], None]) -> None:
        import dask

        self._client, self._carsim, self._print_line = client, carsim, print_line
        self._wait_s = float(dask.utils.parse_timedelta(dask.config.get("foldcar.wait", WAIT)))
        self._lock = threading.RLock()
        self._stopped = threading.Event()
        self._recipes: dict[Runner, Recipe] = {}
        # Each worker's number of threads, and the time at which they were last read from the scheduler, which has not
        # happened yet.
        self._threads: dict[str, int] = {}
        self._updated_s = -math.inf
        # Why a worker cannot run a recipe; "" if it can.
        self._faults: dict[tuple[Recipe, str], str] = {}

    @property
    def count(self) -> int:
        """The number of chunks that can run at the same time: the threads of workers without a fault, at least 1."""
        faulty = {worker for (_, worker), fault in self._faults.items() if fault}
        threads = sum(threads for worker, threads in self._threads.items() if worker not in faulty)
        return min(max(1, threads), self.max_count)

    def stop(self, runner: Runner) -> None:
        """Stop all runs, those of other runners, too; `run` raises FoldcarError."""
        self._stopped.set()

    def run(
        self, runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> tuple[list[dict[str, Any]], float]:
        """Return the answers of ``runner.run`` on a worker, and the time of simulation (s). Raises FoldcarError.

        A chunk that kills its workers is halved, until the run that kills them is alone.
        """
        import distributed

        with self._lock:
            if runner not in self._recipes:
                self._recipes[runner] = recipe_of(runner, self._carsim)
        chunk = bodies, scenes, requests
        try:
            return self._result(self._recipes[runner], chunk)
        except distributed.KilledWorker:
            if len(requests) == 1:
                return [{"error": "the simulation killed its worker each time"}], 0.0
            half = len(requests) // 2
            first_answers, first_s = self.run(runner, bodies, scenes, requests[:half])
            second_answers, second_s = self.run(runner, bodies, scenes, requests[half:])
            return first_answers + second_answers, first_s + second_s
        except (OSError, distributed.client.FutureCancelledError) as error:
            reason = str(error) or type(error).__name__
            raise FoldcarError(f"--scheduler: it no longer answers: {reason}; the same command resumes") from error

    def _result(self, recipe: Recipe, chunk: tuple[Any, ...]) -> tuple[list[dict[str, Any]], float]:
        """Run a chunk on one of the workers that can run the recipe; return what `run_chunk` returns.

        The chunk is submitted again if all these workers disappear.
        """
        while True:
            workers = self._await_workers(recipe)
            future = self._client.submit(run_chunk, recipe, *chunk, workers=workers, retries=RETRIES, pure=False)
            if self._wait(future, workers):
                answers: tuple[list[dict[str, Any]], float] = future.result()
                return answers
            future.cancel()

    def _wait(self, future: Any, workers: Sequence[str]) -> bool:
        """Wait until ``future`` is done. Return False if all its workers disappear before.

        Dask itself would wait for these workers forever. Raises FoldcarError after `stop`.
        """
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        while not done.wait(POLL_S):
            if not any(worker in self._threads for worker in workers):
                return done.is_set()
            self._update_workers()
        return True

    def _await_workers(self, recipe: Recipe) -> list[str]:
        """Wait for workers that can run the recipe, and return them.

        Raises FoldcarError if there is none within the time limit, or after `stop`.
        """
        started_s = time.monotonic()
        is_announced = False
        while True:
            with self._lock:
                # This raises FoldcarError after `stop`.
                self._update_workers()
                self._check_workers(recipe)
                workers = [worker for worker in self._threads if not self._faults[recipe, worker]]
            if workers:
                return workers
            message = f"there is no worker{' that can run this sweep' if self._threads else ''}"
            if time.monotonic() - started_s > self._wait_s:
                raise FoldcarError(f"--scheduler: {message} for {self._wait_s:g} s; the same command resumes")
            if not is_announced:
                is_announced = True
                self._print_line(f"--scheduler: {message}; waiting up to {self._wait_s:g} s")
            # Wait a second, or less if `stop` is called.
            self._stopped.wait(POLL_S)

    def _update_workers(self) -> None:
        """Ask the scheduler for its workers, at most once in POLL_S. Raises FoldcarError after `stop`."""
        if self._stopped.is_set():
            raise FoldcarError("stopped")
        with self._lock:
            if time.monotonic() - self._updated_s >= POLL_S:
                self._threads, self._updated_s = self._client.nthreads(), time.monotonic()

    def _check_workers(self, recipe: Recipe) -> None:
        """Check whether new workers can run a recipe, and print a line for each worker that cannot.

        The fault of each worker is kept; it is "" if there is none.
        """
        new_workers = [worker for worker in self._threads if (recipe, worker) not in self._faults]
        if not new_workers:
            return
        # Ask each worker for its version of foldcar. A worker without foldcar answers with an exception.
        versions = self._client.run(importlib.metadata.version, "foldcar", workers=new_workers, on_error="return")
        same_version = [worker for worker in new_workers if versions.get(worker) == __version__]
        faults = {}
        if same_version:
            faults = self._client.run(fault_of_worker, recipe, workers=same_version, on_error="return")
        for worker in new_workers:
            version = versions.get(worker)
            if worker in faults:
                fault = str(faults[worker])
            elif isinstance(version, str):
                fault = f"it has foldcar {version}, here is {__version__}: install the same there"
            else:
                fault = f"it has no foldcar: pip install 'foldcar[cluster]=={__version__}' in its environment"
            # A worker's fault is printed once, not for each recipe.
            if fault and not self._has_fault(worker):
                self._print_line(f"worker {worker} gets no runs: {fault}")
            self._faults[recipe, worker] = fault

    def _has_fault(self, worker: str) -> bool:
        """Return whether the worker cannot run one of the recipes that were checked."""
        return any(fault and other == worker for (_, other), fault in self._faults.items())
