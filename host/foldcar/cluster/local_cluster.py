"""A scheduler and worker processes of this machine, on loopback, which end with the process that started them.

A process with their number as argument starts them, prints the scheduler's address and stays until nothing reads its
output any more; then it ends its process group, the workers, by force.
"""

import contextlib
import logging
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from typing import NoReturn

from foldcar.errors import FoldcarError
from foldcar.installation import python_command
from foldcar.simulation.runner import process_ending
from foldcar.simulation.worker import wait_for_no_reader

LOOPBACK = "127.0.0.1"


@contextlib.contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """The address of a scheduler with so many workers. FoldcarError if it does not start."""
    with tempfile.TemporaryFile("w+", errors="replace") as messages:
        process = subprocess.Popen(
            # Isolated, as are then the processes that it starts by `multiprocessing`. Python 3.10 has no -P.
            python_command("foldcar.cluster.local_cluster", str(workers), flags=("-I",)),
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=messages, encoding="utf-8",
            # A session of its own keeps Ctrl-C from it.
            start_new_session=True,
        )  # fmt: skip
        assert process.stdout is not None
        try:
            address = process.stdout.readline().strip()
            if not address:
                messages.seek(0)
                ending = process_ending(process.wait(), messages.read())
                raise FoldcarError(f"--scheduler: the workers of this machine do not start: {ending}")
            yield address
        finally:
            process.stdout.close()
            process.wait()


def main() -> None:
    """Start the workers and wait for the end."""
    output = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    folder = tempfile.mkdtemp(prefix="foldcar-cluster-")
    threading.Thread(target=_end_without_reader, args=(output, folder), daemon=True).start()
    import distributed

    cluster = distributed.LocalCluster(
        n_workers=int(sys.argv[1]), threads_per_worker=1, host=LOOPBACK, dashboard_address=None,
        worker_dashboard_address=None, memory_limit=0, local_directory=folder, silence_logs=logging.CRITICAL,
    )  # fmt: skip
    os.write(output, f"{cluster.scheduler_address}\n".encode())
    threading.Event().wait()


def _end_without_reader(pipe: int, folder: str) -> NoReturn:
    wait_for_no_reader(pipe)
    shutil.rmtree(folder, ignore_errors=True)
    os.killpg(os.getpgid(0), signal.SIGKILL)
    os._exit(1)
