"""`carsim batch` as a program: order, streaming, bad lines, exit codes."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.car.design import compose
from foldcar.scenes.source import open_environment
from foldcar.study.experiments import read_study
from study_car import run_carsim

WIDTHS = ("65", "115", "245")
TOP_HEAVY = "top-heavy"
SAMPLES = 4


@pytest.fixture(scope="module")
def definitions() -> list[dict[str, Any]]:
    """Bodies of three widths, a narrow one with its battery on the roof, and a few step-pyramid scenes."""
    project = Path(__file__).resolve().parents[3]
    experiment = read_study(project / "scenarios" / "width_study.json").experiments[0]
    source = open_environment(experiment.program, dict(experiment.scenic_params), experiment.seed)
    bodies = [
        {"body": {"id": f"{design.values['width']:.0f}", **body_json(design)}}
        for design in experiment.family
        if f"{design.values['width']:.0f}" in WIDTHS
    ]
    top_heavy = compose("W_B_W+battery_place=roof", {"width": 54, "height": 60})
    bodies.append({"body": {"id": TOP_HEAVY, **body_json(top_heavy)}})
    return bodies + [{"scene": {"id": str(k), **source.sample(k)}} for k in range(SAMPLES)]


def run_line(body: str, scene: int, **more: Any) -> dict[str, Any]:
    identity = {"id": f"{body}/{scene}", "body": body, "scene": str(scene)}
    return {"run": {**identity, "speed_m_s": 0.69, "time_limit_s": 60, **more}}


def all_runs(**more: Any) -> list[dict[str, Any]]:
    return [run_line(body, scene, **more) for scene in range(SAMPLES) for body in (*WIDTHS, TOP_HEAVY)]


def test_the_same_input_gives_the_same_bytes_in_the_order_of_the_runs(
    carsim_binary: Path, definitions: list[Any]
) -> None:
    lines = definitions + all_runs(path_interval_s=0.1)

    first, second = (run_carsim(carsim_binary, lines) for _ in range(2))

    assert (first.returncode, first.stderr) == (0, "")
    assert first.stdout == second.stdout
    replies = [json.loads(line) for line in first.stdout.splitlines()]
    assert [reply["run"] for reply in replies] == [line["run"]["id"] for line in all_runs()]
    assert {reply["outcome"] for reply in replies} >= {"passed", "tipped", "stuck"}


def test_a_run_does_not_depend_on_those_before_it(carsim_binary: Path, definitions: list[Any]) -> None:
    together = run_carsim(carsim_binary, definitions + all_runs()).stdout.splitlines()

    backwards = run_carsim(carsim_binary, definitions + all_runs()[::-1]).stdout.splitlines()

    assert backwards == together[::-1]


def test_bad_lines_are_answered_in_their_places_and_the_rest_goes_on(carsim_binary: Path, definitions: list[Any]) -> None:
    runs = all_runs()[:3]
    lines = [*definitions, runs[0], "nonsense", runs[1], " ", run_line("no such", 0), runs[2]]

    answer = run_carsim(carsim_binary, lines)

    replies = [json.loads(line) for line in answer.stdout.splitlines()]
    assert [reply.get("run", "error") for reply in replies] == ["65/0", "error", "115/0", "error", "245/0"]
    assert replies[1]["error"]["line"] == len(definitions) + 2
    # A line of white space is counted, but not answered.
    assert replies[3]["error"]["line"] == len(definitions) + 5
    assert {replies[line]["error"]["kind"] for line in (1, 3)} == {"input"}
    assert replies[3]["error"]["run"] == "no such/0"
    assert answer.returncode == 2


def test_a_run_is_answered_before_the_next_line_is_sent(carsim_binary: Path, definitions: list[Any]) -> None:
    with subprocess.Popen([carsim_binary, "batch"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        for line in definitions:
            process.stdin.write(json.dumps(line) + "\n")
        for run in all_runs()[:3]:
            process.stdin.write(json.dumps(run) + "\n")
            process.stdin.flush()
            assert json.loads(process.stdout.readline())["run"] == run["run"]["id"]
        process.stdin.close()
        assert process.wait(10) == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("fly",), "unknown command fly"),
        (("batch", "--jobs"), "batch: unknown option --jobs"),
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
