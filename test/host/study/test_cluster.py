"""Sweeps at the workers of a real Dask scheduler: the rows of a local sweep, whatever becomes of the workers."""

import contextlib
import json
import os
import shlex
import signal
import ssl
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from foldcar import __version__
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.check import store_digest
from foldcar.store.reader import Store
from foldcar.study.cluster import simulators
from foldcar.study.cluster.simulators import check_scheduler, open_cluster
from foldcar.study.experiments import read_study
from foldcar.study.sweep import Sweep
from shell_signals import like_a_shell
from study_car import car_texts, empty_scene
from test_interrupts import MARK, marked

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

DASK = str(Path(sys.executable).with_name("dask"))
WORKER = ("--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1")
WAIT_S = 60.0
# Runs beside Scenic: where the goal is far they fail, and say where.
BESIDE = "model model\nego = new Robot at (0, 0), facing -90 deg\nnew Goal at (Uniform(0.5, 1.2), 0), facing -90 deg\n"
RECORDS = BESIDE + "from lib.far import far\nrecord far(ego) as way\n"
FAR = (
    "import os\nfrom pathlib import Path\nLIMIT = float(Path(__file__).with_name('far.txt').read_text())\n"
    # A folder that is listed has on a worker what it has here, also files that are not read.
    "assert sorted(n for n in os.listdir(Path(__file__).parent) if n[0] != '_') == ['far.py', 'far.txt', 'unread']\n"
    "def far(car):\n    assert car.position.x < LIMIT, 'too far'\n    return car.position.x\n"
)


class Cluster:
    """A scheduler and workers, each a process of its own, on loopback."""

    def __init__(self, folder: Path, **environment: str) -> None:
        self.file = folder / "scheduler.json"
        self.processes: list[subprocess.Popen[bytes]] = []
        words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file)]
        self.start("scheduler", *words, **environment)
        while not self.file.exists() or not self.file.read_text().endswith("}"):
            time.sleep(0.05)
        self.address: str = json.loads(self.file.read_text())["address"]

    def start(self, *words: str, **environment: str | Path) -> "subprocess.Popen[bytes]":
        process = subprocess.Popen(
            [DASK, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            env={**os.environ, **{name: str(value) for name, value in environment.items()}},
        )  # fmt: skip
        self.processes.append(process)
        return process

    def worker(self, nanny: str = "--no-nanny", **environment: str | Path) -> "subprocess.Popen[bytes]":
        return self.start("worker", self.address, *WORKER, nanny, **environment)

    def close(self) -> None:
        for process in self.processes:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler, and a worker that stays."""
    started = Cluster(tmp_path_factory.mktemp("cluster"))
    started.worker()
    yield started
    started.close()


@pytest.fixture
def listing(tmp_path: Path, listing_data: dict[str, Any], write_listing: Callable[[Any], Path]) -> Path:
    """An experiment in carsim's batch, and one with Scenic and files beside it of which some runs fail."""
    (tmp_path / "beside.scenic").write_text(RECORDS)
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "far.py").write_text(FAR)
    (tmp_path / "lib" / "unread").write_text("not read")
    (tmp_path / "lib" / "far.txt").write_text("0.6")
    listing_data["environments"]["2"] = {"scenic_filename": "beside.scenic", "seed": 1}
    listing_data["experiments"]["2"] = {"veh_id": 1, "env_id": 2, "params": {"timeout": 5, "environments": 4}}
    return write_listing(listing_data)


def digest(store: Path) -> tuple[str, int]:
    with Store.open(store) as opened:
        return store_digest(opened)


def test_the_rows_are_those_of_a_local_sweep_and_a_worker_of_another_build_gets_none(
    cluster: Cluster, listing: Path, tmp_path: Path, carsim_binary: Path, foldcar: Callable[..., Any]
) -> None:
    build = Carsim(carsim_binary).build
    other = tmp_path / "carsim"
    other.write_text(f'#!/bin/sh\n{shlex.quote(str(carsim_binary))} "$@" | sed s/{build}/anotherbuild/\n')
    other.chmod(0o755)
    cluster.worker(FOLDCAR_CARSIM=other)
    local = foldcar("sweep", listing, "--store", "local.db", "--jobs", "1")
    with distributed.Client(cluster.address) as client:
        client.wait_for_workers(2, timeout=WAIT_S)

    remote = foldcar("sweep", listing, "--store", "remote.db", "--scheduler", cluster.address)

    assert (local.returncode, remote.returncode) == (1, 1), remote.stderr
    (line,) = [line for line in remote.stderr.splitlines() if "gets no runs" in line]
    assert (
        f"the worker's carsim is build anotherbuild, this sweep's is {build}" in line
        and "worker tcp://127.0.0.1:" in line
    )
    assert digest(tmp_path / "remote.db") == digest(tmp_path / "local.db")
    with Store.open(tmp_path / "remote.db") as store:
        outcomes = {result.outcome for result in store.results("2")}
        messages = {result.message for result in store.results("2") if result.message}
    assert outcomes == {"failed", "passed"}
    assert all(f"{tmp_path}/beside.scenic: sample" in message and "too far" in message for message in messages)
    cluster.processes.pop().kill()


def swept(study: Any, store: Path, binary: Path, places: Any, report: Any = lambda _: None) -> tuple[str, int]:
    Sweep(study, store, Carsim(binary), "test", realities=0).run(places, report)
    return digest(store)


def test_a_worker_killed_in_the_middle_costs_nothing(
    cluster: Cluster, tmp_path: Path, carsim_binary: Path, listing: Path
) -> None:
    study = read_study(listing, "1", 20)
    victim = cluster.worker()
    killed = threading.Event()
    with distributed.Client(cluster.address) as client:
        client.wait_for_workers(2, timeout=WAIT_S)

    def kill(progress: Any) -> None:
        if progress.new and not killed.is_set():
            killed.set()
            victim.kill()

    with open_cluster(cluster.address, Carsim(carsim_binary), lambda line: None) as places:
        remote = swept(study, tmp_path / "remote.db", carsim_binary, places, kill)

    assert killed.is_set()
    assert remote == swept(study, tmp_path / "local.db", carsim_binary, 2)


@pytest.fixture(scope="module")
def chunk() -> dict[str, Any]:
    """Runs of one car, as `run` takes them."""
    drive = json.dumps({"speed_m_s": 0.69, "time_limit_s": 60})
    return {
        "bodies": {"b": car_texts()[0]},
        "scenes": {"s": json.dumps(empty_scene(goal_x_m=1.3))},
        "requests": [RunRequest("b", "s", drive, f"run {i}", 0) for i in range(4)],
    }


def test_a_worker_without_foldcar_is_named_with_the_fix_and_lives(
    cluster: Cluster, tmp_path: Path, carsim_binary: Path, chunk: dict[str, Any]
) -> None:
    (tmp_path / "packages").mkdir()
    for entry in Path(distributed.__file__).parents[1].iterdir():
        if "foldcar" not in entry.name:
            (tmp_path / "packages" / entry.name).symlink_to(entry)
    code = f"sys.path.append({str(tmp_path / 'packages')!r}); from distributed.cli.dask_worker import main; main()"
    command = [sys.executable, "-I", "-S", "-c", f"import sys; {code}", cluster.address, *WORKER, "--no-nanny"]
    bare = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    carsim, lines = Carsim(carsim_binary), list[str]()
    with distributed.Client(cluster.address) as client:
        client.wait_for_workers(2, timeout=WAIT_S)
        begun_s = time.monotonic()
        with open_cluster(cluster.address, carsim, lines.append) as places:
            answers, _ = places.run(carsim, **chunk)
        took_s = time.monotonic() - begun_s

        assert answers == carsim.run(**chunk)
        (line,) = [line for line in lines if "no foldcar" in line]
        assert f"gets no runs: it has no foldcar: pip install 'foldcar[cluster]=={__version__}'" in line
        assert took_s < 10 and bare.poll() is None and len(client.nthreads()) == 2
    bare.kill()
    bare.wait()


def test_a_run_that_ends_its_worker_each_time_is_the_only_one_that_fails(
    tmp_path: Path, carsim_binary: Path, chunk: dict[str, Any]
) -> None:
    deadly = tmp_path / "carsim"
    deadly.write_text(
        f'#!/bin/sh\n[ "$1" = batch ] || exec {shlex.quote(str(carsim_binary))} "$@"\n'
        f'cat >"$0.$$"; grep -q \'"time_limit_s": 59\' "$0.$$" && kill -9 $PPID\n'
        f'exec {shlex.quote(str(carsim_binary))} batch <"$0.$$"\n'
    )
    deadly.chmod(0o755)
    carsim = Carsim(carsim_binary)
    first, *_, last = chunk["requests"]
    poison = RunRequest("b", "s", first.settings.replace("60", "59"), "poison", 0)
    with contextlib.closing(Cluster(tmp_path, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0")) as own:
        own.worker("--nanny", FOLDCAR_CARSIM=deadly)
        with open_cluster(own.address, carsim, lambda line: None) as places:
            answers, _ = places.run(carsim, chunk["bodies"], chunk["scenes"], [poison, last])

    assert answers[0] == {"error": "the simulation killed its worker each time"}
    assert answers[1:] == carsim.run(chunk["bodies"], chunk["scenes"], [last])


def test_without_scheduler_or_workers_or_with_other_versions_one_line_says_so(
    tmp_path: Path, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch, cluster: Cluster
) -> None:
    carsim, lines = Carsim(carsim_binary), list[str]()
    monkeypatch.setattr(simulators, "CONNECT_S", 1)

    def opened(address: str) -> None:
        with open_cluster(address, carsim, lines.append) as places:
            places.run(carsim, {}, {}, [RunRequest("b", "s", '{"time_limit_s": 1}', "run", 0)])

    with pytest.raises(FoldcarError, match=r"--scheduler: tcp://127.0.0.1:1: no Dask scheduler answers there: "):
        opened("tcp://127.0.0.1:1")
    with pytest.raises(FoldcarError, match="--jobs: has no effect with --scheduler"):
        check_scheduler("local:1", 2)
    for wrong in ("nowhere", "local:0", "local:x", "tcp://host", "local:257"):
        with pytest.raises(FoldcarError, match="--scheduler: "):
            opened(wrong)
    with monkeypatch.context() as patched, pytest.raises(FoldcarError, match=r"runs distributed \S+, here is 1\.0"):
        patched.setattr(distributed, "__version__", "1.0")
        opened(cluster.address)
    with contextlib.closing(Cluster(tmp_path)) as empty, dask.config.set({"foldcar.wait": "1s"}):
        with pytest.raises(FoldcarError, match="there is no worker for 1 s; the same command resumes"):
            opened(empty.address)
        assert lines == ["--scheduler: there is no worker; waiting up to 1 s"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_workers_of_this_machine_speak_tls_and_end_with_the_command(
    listing: Path, tmp_path: Path, number: signal.Signals
) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "foldcar", "sweep", str(listing), "--store", "s.db", "--samples", "1000",
         "--scheduler", "local:1"],
        cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=like_a_shell,
        env={**os.environ, MARK: str(tmp_path)},
    )  # fmt: skip
    try:
        deadline_s = time.monotonic() + WAIT_S
        while not (tmp_path / "s.db").exists():
            assert time.monotonic() < deadline_s and process.poll() is None
            time.sleep(0.02)
        # The command, its worker and a process that watches over semaphores.
        assert len(marked(str(tmp_path))) >= 2
        # Scheduler and nanny; Dask's third port has pages only.
        assert sum(speaks_tls(port) for port in listening(process.pid)) == 2
    except BaseException:
        process.kill()
        raise

    os.killpg(process.pid, number)
    errors = process.communicate(timeout=WAIT_S)[1]

    while marked(str(tmp_path)) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    assert marked(str(tmp_path)) == []
    expected_lines = ("within the time limit", "note:", "the same course")
    lines = [line for line in errors.splitlines() if not any(text in line for text in expected_lines)]
    assert (process.returncode, len(lines)) == ((130, 1) if number == signal.SIGINT else (-9, 0)), errors


def listening(process: int) -> set[int]:
    """The TCP ports at which a process listens."""
    links = []
    for file in Path(f"/proc/{process}/fd").iterdir():
        # The process may close a descriptor while the folder is read.
        with contextlib.suppress(FileNotFoundError):
            links.append(str(file.readlink()))
    rows = [row.split() for row in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {int(row[1].partition(":")[2], 16) for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in links}


def speaks_tls(port: int) -> bool:
    try:
        return bool(ssl.get_server_certificate(("127.0.0.1", port), timeout=5))
    except OSError:
        return False
