"""`make cluster-check`: sweeps over hosts that are network namespaces, with delay, loss, deaths and a partition.

Input: a folder for the stores. Output: what happened, a line each; exit code 1 if a digest is not the local sweep's.
Each host has its own address: a client, a scheduler, four workers. Half of the workers are killed in the
middle, one is cut off for some time. Then the same over TLS on loopback. Needs root; says so and ends without it.
"""

import argparse
import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from lossy_network import SUBNET, LossyNetwork

PROJECT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
LISTING = PROJECT / "scenarios" / "width_study.json"
WORKERS = 4
DELAY_S, LOSS = 0.02, 0.01
# Longer than the 30 s after which Dask gives up a connection on which nothing is acknowledged.
CUT_S = 45.0
LIMIT_S = 1200.0


class Programs:
    """Programs that end with this one. A context manager."""

    def __init__(self) -> None:
        self.started: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> "Programs":
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.started:
            end(process)

    def start(self, words: Sequence[str | Path], environment: Mapping[str, str]) -> "subprocess.Popen[bytes]":
        """Start a program."""
        process = subprocess.Popen(
            words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            env={**os.environ, **environment},
        )  # fmt: skip
        self.started.append(process)
        return process


def end(process: "subprocess.Popen[bytes]") -> None:
    """Kill a program that was started here, and its children."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def run(*words: str | Path) -> str:
    """The output of a program that succeeds."""
    return subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True, timeout=LIMIT_S).stdout


def say(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)


def digest(store: Path) -> str:
    """The digest of a store's runs."""
    return run(BIN / "foldcar", "export", store, "--digest").strip()


def runs_in(store: Path) -> int:
    """How many runs the store has so far."""
    address = f"file:{store}?mode=ro"
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(address, uri=True)) as connection:
        return int(connection.execute("SELECT count(*) FROM run").fetchone()[0])
    return 0


def await_runs(store: Path, count: int, sweep: "subprocess.Popen[str]") -> None:
    """Wait until the store has so many runs."""
    while runs_in(store) < count and sweep.poll() is None:
        time.sleep(0.2)


def sweep_words(store: Path, environments: int, *more: str) -> list[str | Path]:
    """The command of a sweep."""
    return [BIN / "foldcar", "sweep", LISTING, "--store", store, "--environments", str(environments), *more]


def over_hosts(network: LossyNetwork, programs: Programs, folder: Path, environments: int) -> str:
    """The digest of a sweep over hosts of which half are killed and one is cut off."""
    scheduler = f"tcp://{SUBNET}.2:8786"
    start = ["scheduler", "--host", f"{SUBNET}.2", "--port", "8786", "--no-dashboard"]
    programs.start(network.command(2, BIN / "dask", *start), {})
    options = ["--nthreads", "1", "--no-dashboard", "--local-directory", str(folder)]
    workers = [
        programs.start(
            network.command(host, BIN / "dask", "worker", scheduler, "--host", f"{SUBNET}.{host}", *options), {}
        )
        for host in range(3, 3 + WORKERS)
    ]
    store = folder / "hosts.db"
    words = network.command(1, *sweep_words(store, environments, "--scheduler", scheduler))
    start_s = time.monotonic()
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as sweep:
        await_runs(store, 1, sweep)
        total = 37 * environments
        await_runs(store, total // 5, sweep)
        for worker in workers[: WORKERS // 2]:
            end(worker)
        say(f"  {time.monotonic() - start_s:.0f} s: {runs_in(store)} of {total} runs: {WORKERS // 2} workers killed")
        await_runs(store, 2 * total // 5, sweep)
        network.cut(3 + WORKERS - 1, True)
        say(f"  {time.monotonic() - start_s:.0f} s: {runs_in(store)} of {total} runs: worker {WORKERS} cut off")
        cut_s = time.monotonic()
        while sweep.poll() is None and time.monotonic() - cut_s < CUT_S:
            time.sleep(0.2)
        network.cut(3 + WORKERS - 1, False)
        say(f"  {time.monotonic() - start_s:.0f} s: {runs_in(store)} of {total} runs: connected again")
        said = sweep.communicate(timeout=LIMIT_S)[0]
    for line in said.splitlines():
        say(f"  | {line}")
    return digest(store)


def over_tls(programs: Programs, folder: Path, environments: int) -> str:
    """The digest of a sweep over TLS on loopback; AssertionError if one without a certificate gets in."""
    key, certificate = folder / "key.pem", folder / "certificate.pem"
    run("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=foldcar",
        "-keyout", key, "-out", certificate)  # fmt: skip
    tls = {"DASK_DISTRIBUTED__COMM__TLS__CA_FILE": str(certificate), "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "True"}
    for role in ("SCHEDULER", "WORKER", "CLIENT"):
        tls[f"DASK_DISTRIBUTED__COMM__TLS__{role}__KEY"] = str(key)
        tls[f"DASK_DISTRIBUTED__COMM__TLS__{role}__CERT"] = str(certificate)
    scheduler = "tls://127.0.0.1:8797"
    common = ["--host", "127.0.0.1", "--no-dashboard", "--protocol", "tls"]
    programs.start([BIN / "dask", "scheduler", "--port", "8797", *common], tls)
    programs.start([BIN / "dask", "worker", scheduler, "--nthreads", "2", "--local-directory", str(folder), *common], tls)
    words = sweep_words(folder / "tls.db", environments, "--scheduler", scheduler)
    subprocess.run(words, check=True, env={**os.environ, **tls}, stdout=subprocess.DEVNULL, timeout=LIMIT_S)
    outside = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S)
    assert outside.returncode == 2, f"without a certificate: {outside}"
    say(f"  without a certificate: {outside.stderr.strip()[:150]}")
    return digest(folder / "tls.db")


def main() -> None:
    """Run the checks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="a folder for the stores, which is emptied first")
    parser.add_argument("--environments", type=int, default=12)
    options = parser.parse_args()
    folder: Path = options.folder.resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    start_s = time.monotonic()
    run(*sweep_words(folder / "local.db", options.environments))
    local = digest(folder / "local.db")
    say(f"local sweep: {time.monotonic() - start_s:.0f} s, digest {local}")
    failed = False
    try:
        network = LossyNetwork(2 + WORKERS, DELAY_S, LOSS)
    except (OSError, subprocess.CalledProcessError) as error:
        why = error.stderr.strip() if isinstance(error, subprocess.CalledProcessError) else error
        say(f"network namespaces: skipped, they are not permitted here: {why}")
    else:
        with contextlib.closing(network), Programs() as programs:
            start_s = time.monotonic()
            say(f"sweep over {WORKERS} hosts, frames {1000 * DELAY_S:g} ms late, {100 * LOSS:g} % of them lost:")
            found = over_hosts(network, programs, folder, options.environments)
            say(f"  {network.frames} frames arrived, {network.lost} were lost")
            say(f"  {time.monotonic() - start_s:.0f} s, digest {'equal' if found == local else f'OTHER: {found}'}")
            failed |= found != local
    with Programs() as programs:
        say("sweep over TLS:")
        found = over_tls(programs, folder, options.environments)
        say(f"  digest {'equal' if found == local else f'OTHER: {found}'}")
        failed |= found != local
    sys.exit(failed)


if __name__ == "__main__":
    main()
