"""`carsim batch` as a program: order, job counts, streaming, crashes, exit codes."""

import contextlib
import json
import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.scenes.source import open_environment
from foldcar.study.experiments import read_study

WIDTHS = ("65", "115", "245")
SAMPLES = 4


@pytest.fixture(scope="module")
def definitions() -> list[dict[str, Any]]:
    """Bodies of three widths and a few step-pyramid scenes."""
    project = Path(__file__).resolve().parents[2]
    experiment = read_study(project / "scenarios" / "width_study.json").experiments[0]
    source = open_environment(experiment.program, dict(experiment.scenic_params), experiment.seed)
    bodies = [
        {"body": {"id": f"{design.values['width']:.0f}", **body_json(design)}}
        for design in experiment.family
        if f"{design.values['width']:.0f}" in WIDTHS
    ]
    return bodies + [{"scene": {"id": str(k), **source.sample(k)}} for k in range(SAMPLES)]


def run_line(body: str, scene: int, **more: Any) -> dict[str, Any]:
    identity = {"id": f"{body}/{scene}", "body": body, "scene": str(scene)}
    return {"run": {**identity, "speed_m_s": 0.69, "time_limit_s": 60, **more}}


def all_runs(**more: Any) -> list[dict[str, Any]]:
    return [run_line(body, scene, **more) for scene in range(SAMPLES) for body in WIDTHS]


def batch(carsim: Path, lines: list[Any], *options: str) -> "subprocess.CompletedProcess[str]":
    text = "".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines)
    return subprocess.run([carsim, "batch", *options], input=text, capture_output=True, text=True, timeout=6000)


def test_any_number_of_jobs_writes_the_same_bytes_in_the_order_of_the_runs(
    carsim_binary: Path, definitions: list[Any]
) -> None:
    lines = definitions + all_runs(path_interval_s=0.1)

    answers = [batch(carsim_binary, lines, "--jobs", str(jobs)) for jobs in (1, 2, 5)]

    assert {answer.returncode for answer in answers} == {0}
    assert len({answer.stdout for answer in answers}) == 1
    replies = [json.loads(line) for line in answers[0].stdout.splitlines()]
    assert [reply["run"] for reply in replies] == [line["run"]["id"] for line in all_runs()]
    assert {reply["outcome"] for reply in replies} >= {"passed", "tipped", "stuck"}


def test_timing_changes_no_reply_and_sums_up(carsim_binary: Path, definitions: list[Any]) -> None:
    lines = definitions + all_runs()

    timed = batch(carsim_binary, lines, "--jobs", "2", "--timing")

    assert timed.stdout == batch(carsim_binary, lines).stdout
    timing = json.loads(timed.stderr)["timing"]
    simulated_s = sum(json.loads(line)["elapsed_time_s"] for line in timed.stdout.splitlines())
    assert timing["simulated_s"] == pytest.approx(simulated_s)
    assert 0 < timing["firmware_s"] < timing["terrain_s"] < timing["physics_s"] < 2 * timing["wall_s"]


def test_bad_lines_are_answered_in_their_places_and_the_rest_goes_on(
    carsim_binary: Path, definitions: list[Any]
) -> None:
    runs = all_runs()[:3]
    lines = [*definitions, runs[0], "nonsense", runs[1], run_line("no such", 0), runs[2]]

    answer = batch(carsim_binary, lines, "--jobs", "2")

    replies = [json.loads(line) for line in answer.stdout.splitlines()]
    assert [reply.get("run", "error") for reply in replies] == ["65/0", "error", "115/0", "error", "245/0"]
    assert replies[1]["error"]["line"] == len(definitions) + 2
    assert {replies[line]["error"]["kind"] for line in (1, 3)} == {"input"}
    assert replies[3]["error"]["run"] == "no such/0"
    assert answer.returncode == 2


def test_a_run_is_answered_before_the_next_line_is_sent(carsim_binary: Path, definitions: list[Any]) -> None:
    with subprocess.Popen(
        [carsim_binary, "batch", "--jobs", "2"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        for line in definitions:
            process.stdin.write(json.dumps(line) + "\n")
        for run in all_runs()[:3]:
            process.stdin.write(json.dumps(run) + "\n")
            process.stdin.flush()
            assert json.loads(process.stdout.readline())["run"] == run["run"]["id"]
        process.stdin.close()
        assert process.wait(10) == 0


def fields(pid: int | str) -> list[str]:
    """State, parent and so on of a process, from the kernel; empty if it is gone."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return []


def children(pid: int) -> list[int]:
    processes = [entry.name for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    return [int(name) for name in processes if fields(name)[1:2] == [str(pid)]]


def processor_time_s(pid: int) -> float:
    """What a process has used of the processor; 0 if it is gone."""
    return sum(map(int, fields(pid)[11:13])) / os.sysconf("SC_CLK_TCK")


def test_a_worker_that_crashes_takes_only_its_run_along(carsim_binary: Path, definitions: list[Any]) -> None:
    # A slow drive of an hour on level ground takes seconds to simulate, enough time to kill its worker.
    endless = run_line("115", 0, speed_m_s=0.2, time_limit_s=3600, parameters={"TRIAL_MAX_S": 3600})
    for line in definitions:
        if "scene" in line and line["scene"]["id"] == "0":
            wide = {"x_min_m": -900, "x_max_m": 900, "y_min_m": -900, "y_max_m": 900}
            goal = {"kind": "disc", "x_m": -800, "y_m": 0, "radius_m": 1}
            circle = {"scene": {**line["scene"], "terrain": [], "course": wide, "goal": goal}}
    with subprocess.Popen(
        [carsim_binary, "batch", "--jobs", "1"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        for line in [*definitions, circle, endless, run_line("115", 1)]:
            process.stdin.write(json.dumps(line) + "\n")
        process.stdin.close()
        while not (workers := children(process.pid)):
            time.sleep(0.01)
        (worker,) = workers
        # It drives once it has used up some of the processor.
        while processor_time_s(worker) < 0.2:
            time.sleep(0.01)
        os.kill(worker, signal.SIGSEGV)
        replies = [json.loads(line) for line in process.stdout]

    assert replies[0]["error"]["run"] == "115/0"
    assert replies[0]["error"]["kind"] == "simulation"
    assert "crashed (signal Segmentation fault)" in replies[0]["error"]["message"]
    assert replies[1]["run"] == "115/1"
    assert process.returncode == 2


def test_no_worker_outlives_a_batch_that_is_killed(carsim_binary: Path) -> None:
    with subprocess.Popen([carsim_binary, "batch", "--jobs", "3"], stdin=subprocess.PIPE) as process:
        deadline_s = time.monotonic() + 100
        while len(workers := children(process.pid)) < 3 and time.monotonic() < deadline_s:
            time.sleep(0.01)
        assert len(workers) == 3
        process.kill()
    while workers and time.monotonic() < deadline_s:
        time.sleep(0.01)
        workers = [pid for pid in workers if fields(pid)[:1] not in ([], ["Z"])]
    assert workers == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "no command"),
        (("fly",), "unknown command fly"),
        (("batch", "--jobs", "0"), "--jobs: 0 is not a number from 1 to 256"),
        (("batch", "--jobs"), "unknown or incomplete option --jobs"),
        (("params", "x"), "params takes no further words"),
    ],
)
def test_wrong_words_are_named(carsim_binary: Path, words: tuple[str, ...], message: str) -> None:
    answer = subprocess.run([carsim_binary, *words], capture_output=True, text=True, stdin=subprocess.DEVNULL)

    assert answer.returncode == 2
    assert answer.stderr.startswith(f"carsim: {message}") or message in answer.stderr.splitlines()[0]


def test_a_full_disk_is_one_line(carsim_binary: Path, definitions: list[Any]) -> None:
    text = "".join(json.dumps(line) + "\n" for line in [*definitions, *all_runs()[:2]])
    with Path("/dev/full").open("w") as full:
        answer = subprocess.run(
            [carsim_binary, "batch"], input=text, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60
        )

    assert answer.returncode == 2
    assert answer.stderr == "carsim: cannot write the output: No space left on device\n"
