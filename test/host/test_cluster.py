"""Sweeps at the workers of a real Dask scheduler: the rows of a local sweep, whatever becomes of the workers."""

import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from foldcar.cluster import connection, workers
from foldcar.cluster.chunk import Simulated, Trouble, recipe_of, run_chunk
from foldcar.cluster.connection import check_scheduler, open_cluster
from foldcar.cluster.local_cluster import local_cluster
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.check import store_digest
from foldcar.store.reader import Store
from foldcar.study.experiments import read_study
from foldcar.study.sweep import Sweep
from shell_signals import like_a_shell
from study_car import car_texts, empty_scene
from test_interrupts import MARK, marked

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

DASK = str(Path(sys.executable).with_name("dask"))
WAIT_S = 60.0
# Runs beside Scenic: where the goal is far they fail, and say where.
BESIDE = "model model\nego = new Robot at (0, 0), facing -90 deg\nnew Goal at (Uniform(0.5, 1.2), 0), facing -90 deg\n"
RECORDS = BESIDE + "from lib.far import far\nrecord far(ego) as way\n"
FAR = (
    "from pathlib import Path\nLIMIT = float(Path(__file__).with_name('far.txt').read_text())\n"
    "def far(car):\n    assert car.position.x < LIMIT, 'too far'\n    return car.position.x\n"
)


class Cluster:
    """A scheduler and workers, each a process of its own, on loopback."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.processes: list[subprocess.Popen[bytes]] = []
        words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file)]
        self.start("scheduler", *words)
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

    def worker(self, *words: str, **environment: str | Path) -> "subprocess.Popen[bytes]":
        options = ["--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1", *(words or ["--no-nanny"])]
        return self.start("worker", self.address, *options, **environment)

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
    (told,) = [line for line in remote.stderr.splitlines() if "gets no runs" in line]
    assert f"its carsim is build anotherbuild, this sweep's is {build}" in told and "worker tcp://127.0.0.1:" in told
    assert digest(tmp_path / "remote.db") == digest(tmp_path / "local.db")
    with Store.open(tmp_path / "remote.db") as store:
        outcomes = {one.outcome for one in store.results("2")}
        messages = {one.message for one in store.results("2") if one.message}
    assert outcomes == {"failed", "passed"}
    assert all(f"{tmp_path}/beside.scenic: sample" in message and "too far" in message for message in messages)
    cluster.processes.pop().kill()


def swept(study: Any, store: Path, binary: Path, simulators: Any, report: Any = lambda _: None) -> tuple[str, int]:
    Sweep(study, store, Carsim(binary), "test").run(simulators, report)
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


def test_a_worker_that_hangs_is_left_until_it_answers(
    cluster: Cluster, carsim_binary: Path, chunk: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "CHUNK_LIMIT_S", 1.5)
    monkeypatch.setattr(workers, "SILENCE_S", 0.5)
    hanging = cluster.worker()
    carsim = Carsim(carsim_binary)
    said: list[str] = []
    with distributed.Client(cluster.address) as client:
        client.wait_for_workers(2, timeout=WAIT_S)
    with open_cluster(cluster.address, carsim, said.append) as places:
        await_count(places, 2)
        hanging.send_signal(signal.SIGSTOP)
        with ThreadPoolExecutor(4) as pool:
            found = [pool.submit(places.run, carsim, **chunk) for _ in range(4)]
            answers = [one.result(WAIT_S)[0] for one in found]
        assert places.count == 1
        hanging.send_signal(signal.SIGCONT)
        await_count(places, 2)

    assert answers == [carsim.run(**chunk)] * 4
    assert len(said) == 1 and "hangs: no answer for" in said[0]
    hanging.kill()


def await_count(places: Any, count: int) -> None:
    deadline_s = time.monotonic() + WAIT_S
    while places.count != count:
        assert time.monotonic() < deadline_s, f"{places.count} places, not {count}"
        time.sleep(0.05)


def test_a_run_that_ends_its_worker_each_time_is_the_only_one_that_fails(
    tmp_path: Path, carsim_binary: Path, chunk: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "LOSSES", 2)
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
    with contextlib.closing(Cluster(tmp_path)) as own:
        # Without a nanny each ends for good: two with the chunk, one more with the run alone.
        for _ in range(4):
            own.worker(FOLDCAR_CARSIM=deadly)
        with open_cluster(own.address, carsim, lambda line: None) as places:
            await_count(places, 4)
            answers, _ = places.run(carsim, chunk["bodies"], chunk["scenes"], [poison, last])

    assert answers[0] == {"error": "the simulation ended its worker, 2 times"}
    assert answers[1:] == carsim.run(chunk["bodies"], chunk["scenes"], [last])


def test_a_worker_ends_a_chunk_at_its_limit_and_refuses_another_build(
    carsim_binary: Path, chunk: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    carsim = Carsim(carsim_binary)
    recipe = recipe_of(carsim, carsim)
    slow = tmp_path / "carsim"
    slow.write_text(f'#!/bin/sh\n[ "$1" = batch ] && exec sleep 60\nexec {shlex.quote(str(carsim_binary))} "$@"\n')
    slow.chmod(0o755)

    whole = run_chunk(recipe, **chunk, limit_s=WAIT_S)
    monkeypatch.setenv("FOLDCAR_CARSIM", str(slow))
    other = run_chunk(type(recipe)(recipe.engine, "another", None), **chunk, limit_s=WAIT_S)
    late = run_chunk(recipe, **chunk, limit_s=0.3)

    assert isinstance(whole, Simulated) and whole.answers == carsim.run(**chunk)
    assert isinstance(other, Trouble) and other.kind == "unfit" and carsim.build in other.why and "another" in other.why
    assert isinstance(late, Trouble) and (late.kind, late.why) == ("late", "was not done after 0.3 s")


def test_without_scheduler_or_workers_or_with_other_versions_one_line_says_so(
    tmp_path: Path, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch, cluster: Cluster
) -> None:
    carsim = Carsim(carsim_binary)
    monkeypatch.setattr(connection, "CONNECT_S", 1)
    said: list[str] = []

    def opened(address: str) -> None:
        with open_cluster(address, carsim, said.append) as places:
            places.run(carsim, {}, {}, [RunRequest("b", "s", '{"time_limit_s": 1}', "run", 0)])

    with pytest.raises(FoldcarError, match=r"--scheduler: tcp://127.0.0.1:1: no Dask scheduler answers there: "):
        opened("tcp://127.0.0.1:1")
    with pytest.raises(FoldcarError, match="--jobs: says nothing with --scheduler"):
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
        assert said == [f"scheduler {empty.address}: there is no worker; waiting up to 1 s"]


def test_the_workers_of_this_machine_import_nothing_from_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("json", "random", "socket"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(f'{__name__} of the working directory')\n")
    monkeypatch.chdir(tmp_path)
    with local_cluster(1) as address, distributed.Client(address, timeout=WAIT_S) as client:
        client.wait_for_workers(1, timeout=WAIT_S)
        assert client.submit(max, 1, 2).result(WAIT_S) == 2


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_workers_of_this_machine_end_with_the_command(listing: Path, tmp_path: Path, number: signal.Signals) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "foldcar", "sweep", str(listing), "--store", "s.db", "--environments", "100",
         "--scheduler", "local:1"],
        cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=like_a_shell,
        env={**os.environ, MARK: str(tmp_path)},
    )  # fmt: skip
    deadline_s = time.monotonic() + WAIT_S
    while not (tmp_path / "s.db").exists():
        assert time.monotonic() < deadline_s and process.poll() is None
        time.sleep(0.02)
    # The command, the scheduler, its worker and a process that watches over semaphores.
    assert len(marked(str(tmp_path))) >= 3

    os.killpg(process.pid, number)
    errors = process.communicate(timeout=WAIT_S)[1]

    while marked(str(tmp_path)) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    assert marked(str(tmp_path)) == []
    lines = [line for line in errors.splitlines() if "within the time limit" not in line and "note:" not in line]
    assert (process.returncode, len(lines)) == ((130, 1) if number == signal.SIGINT else (-9, 0)), errors
