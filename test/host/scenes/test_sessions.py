"""Samples in a Python session: after interrupts, in forks and threads, with many programs and changed ones."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import foldcar
from foldcar.scenes import fixed_hash
from foldcar.scenes.fixed_hash import MAX_PROCESSES, open_fixed_environment
from foldcar.scenes.source import SceneSource, open_environment

PROGRAM = """
model model
param width = 0.4
ego = new Robot at (0, 0), facing -90 deg
for k in range(5):
    new Bump at (0.3 + 0.2 * k, Range(-0.2, 0.2)), facing -90 deg, with width globalParameters.width
goal = new Goal at (1.9, 0), facing -90 deg
"""
SAMPLES = 8
FORKED = """
import json, multiprocessing, sys, foldcar
environment = foldcar.environment(sys.argv[1], seed=3)
environment.scene(0)
def drawn(k):
    return json.loads(environment.scene(k).json)
with multiprocessing.get_context("fork").Pool(2) as pool:
    print(json.dumps(pool.map(drawn, range(8), chunksize=1)))
"""


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(fixed_hash, "draws_here", False)
    file = tmp_path / "random.scenic"
    file.write_text(PROGRAM)
    return file


def samples_of(source: SceneSource, count: int = SAMPLES) -> list[Any]:
    return [json.loads(json.dumps(source.sample(k))) for k in range(count)]


@pytest.fixture
def expected(program: Path) -> list[Any]:
    """The samples as this process draws them."""
    return samples_of(open_environment(program, {}, 3))


@pytest.fixture
def busy_threads() -> Iterator[None]:
    """Threads take turns so often that another one runs within each step of Scenic."""
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval_s)


@pytest.mark.parametrize("asked_before", [0, 2])
def test_an_interrupt_while_a_sample_is_drawn_does_not_shift_the_next_ones(
    asked_before: int, program: Path, expected: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A person presses the notebook's button, then runs the cell again. Without a question before, the other process is
    opening the program.
    """
    source = open_fixed_environment(program, {}, 3)
    assert samples_of(source, asked_before) == expected[:asked_before]
    dumps = json.dumps

    def interrupting(line: Any) -> str:
        signal.setitimer(signal.ITIMER_REAL, 0.001)
        return dumps(line)

    previous = signal.signal(signal.SIGALRM, signal.default_int_handler)
    monkeypatch.setattr(json, "dumps", interrupting)
    try:
        with pytest.raises(KeyboardInterrupt):
            source.sample(2)
    finally:
        monkeypatch.setattr(json, "dumps", dumps)
        signal.signal(signal.SIGALRM, previous)
    assert samples_of(source) == expected


def test_a_process_that_has_died_is_replaced(program: Path, expected: list[Any]) -> None:
    source = open_fixed_environment(program, {}, 3)
    assert source.sample(0) == expected[0]
    vars(source)["_process"].kill()
    with pytest.raises(foldcar.FoldcarError, match="the process that draws its samples has died"):
        source.sample(1)
    assert samples_of(source) == expected


def test_forked_processes_draw_samples_at_the_same_time(program: Path, expected: list[Any]) -> None:
    """`multiprocessing` forks before Python 3.14."""
    environment = {**os.environ, "PYTHONHASHSEED": "1"}
    command = [sys.executable, "-c", FORKED, str(program)]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=200, check=True)
    assert json.loads(answer.stdout) == expected


def test_few_processes_wait_and_an_old_program_is_opened_again(program: Path, expected: list[Any]) -> None:
    """Somebody scans a parameter."""
    widths = [0.4, *(0.5 + k / 8 for k in range(MAX_PROCESSES))]
    sources = [open_fixed_environment(program, {"width": width}, 3) for width in widths]
    first_samples = [source.sample(0) for source in sources]

    waiting = [vars(source)["_process"] is not None for source in sources]
    assert waiting == [False, *[True] * MAX_PROCESSES]
    assert [{bump["width_m"] for bump in sample["terrain"]} for sample in first_samples] == [{width} for width in widths]
    assert samples_of(sources[0]) == expected


def test_a_program_that_changes_before_its_first_sample_is_not_mixed_with_the_old_one(program: Path) -> None:
    """Its definition of success is that of the old program."""
    environment = foldcar.environment(program, seed=3)
    program.write_text(PROGRAM + "require always ego.position.x < 1.0\n")
    with pytest.raises(foldcar.FoldcarError, match=r"random\.scenic: has changed while the program was in use"):
        environment.scene(0)
    assert "require" not in environment.success
    assert foldcar.environment(program, seed=3).scene(0).sample == 0


@pytest.mark.usefixtures("busy_threads")
@pytest.mark.parametrize("draws_here", [True, False])
def test_threads_compile_and_draw_at_the_same_time(
    draws_here: bool, program: Path, expected: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody evaluates several cars and programs in a pool of threads."""
    monkeypatch.setattr(fixed_hash, "draws_here", draws_here)
    widths = [0.4, 0.5, 0.6]

    def drawn(k: int) -> Any:
        environment = foldcar.environment(program, seed=3, params={"width": widths[k % 3]})
        return environment, json.loads(environment.scene(k).json)

    with ThreadPoolExecutor(4) as pool:
        drawn_by_threads = list(pool.map(drawn, range(SAMPLES)))

    environments, scenes = zip(*drawn_by_threads, strict=True)
    assert [id(environment) for environment in environments] == [id(environments[k % 3]) for k in range(SAMPLES)]
    for k, scene in enumerate(scenes):
        bumps = [{**bump, "width_m": widths[k % 3]} for bump in expected[k]["terrain"]]
        assert scene == {**expected[k], "terrain": bumps}
    assert samples_of(open_environment(program, {}, 3)) == expected
