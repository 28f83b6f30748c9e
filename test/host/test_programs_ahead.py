"""Programs that a copy of the process compiles ahead: the same facts, notes and scenes, mistakes; nothing left."""

import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.scenes.source import open_environment
from foldcar.simulation.programs_ahead import ProgramsAhead, programs_ahead
from foldcar.study.environments import Environment
from foldcar.study.environments_ahead import environments_ahead
from foldcar.study.experiments import Experiment, read_study
from swept_listing import WriteListing

# Prints while it is compiled, and its note says that the Bump does not follow the Robot.
PROGRAM = """model model
param course_x_max = 4
print("compiled")
ego = new Robot at (0, 0), facing -90 deg
bump = new Bump ahead of ego by Range(0.3, 0.5), with width 0.1, with height 0.01
goal = new Goal at (2, Range(-0.1, 0.1)), facing -90 deg
mutate ego by 0.02
"""
Run = Callable[..., "subprocess.CompletedProcess[str]"]


def children() -> set[int]:
    """Processes that this thread started."""
    return set(map(int, Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()))


@pytest.fixture
def experiment(write_listing: WriteListing, listing_data: Any, tmp_path: Path) -> Experiment:
    (tmp_path / "said.scenic").write_text(PROGRAM)
    listing_data["environments"]["1"]["scenic_filename"] = "said.scenic"
    return read_study(write_listing(listing_data)).experiments[0]


def test_it_gives_what_compiling_here_gives(experiment: Experiment, capsys: pytest.CaptureFixture[str]) -> None:
    before = children()
    with ProgramsAhead() as programs:
        assert len(children() - before) == 1
        ahead, other = (environments_ahead([experiment], programs)[experiment.id] for _ in range(2))
        scenes = [ahead.sample(k) for k in (2, 0)]
        found = (ahead.dynamic, ahead.success.defined, ahead.success.text, ahead.mutation_notes())
        assert other.sample(2) == scenes[0]
        assert ahead._source is other._source is None, "compiled here"
    assert children() == before
    printed = capsys.readouterr().err
    here = open_environment(experiment.program, dict(experiment.scenic_params), experiment.seed, experiment.condition)
    assert scenes == [here.sample(2), here.sample(0)]
    assert found == (here.dynamic, here.success.defined, here.success.text, here.mutation_notes())
    assert len(found[3]) == 1
    assert printed == capsys.readouterr().err
    assert set(printed.split()) == {"compiled"}


@pytest.mark.parametrize("asked", [False, True])
def test_without_the_copy_the_program_is_compiled_here(experiment: Experiment, asked: bool) -> None:
    before = children()
    with ProgramsAhead() as programs:
        environment = environments_ahead([experiment], programs)[experiment.id]
        if asked:
            environment.sample(0)
        (copy,) = children() - before
        os.kill(copy, signal.SIGKILL)
        here = Environment(experiment)
        assert [environment.sample(k) for k in range(3)] == [here.sample(k) for k in range(3)]
        assert environment.success.text == here.success.text
        assert environment.mutation_notes() == here.mutation_notes()


def test_more_questions_and_more_words_than_a_pipe_holds(
    experiment: Experiment, capsys: pytest.CaptureFixture[str]
) -> None:
    experiment.program.write_text(PROGRAM.replace('"compiled"', '"compiled" * 20_000'))
    with ProgramsAhead() as programs:
        environment = environments_ahead([experiment] * 1000, programs)[experiment.id]
        assert environment.success.defined
        assert environment.mutation_notes()
    assert len(capsys.readouterr().err) > 2 * 8 * 20_000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("goal =", "goal = =\ngoal ="), "said.scenic: line 6: "),
        (("mutate", "require goal.position.y > 1\nmutate"), "said.scenic: sample 0: Scenic rejected all"),
    ],
)
def test_a_mistake_is_reported_once_as_without_the_copy(
    experiment: Experiment, foldcar: Run, tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    experiment.program.write_text(PROGRAM.replace(*change))
    words = ["sweep", experiment.program.parent / "listing.json", "--store", tmp_path / "s.db", "--environments", "2"]
    alone, ahead = (foldcar(*words, "--jobs", str(jobs)) for jobs in (1, 2))
    assert (ahead.returncode, ahead.stdout, ahead.stderr) == (alone.returncode, alone.stdout, alone.stderr)
    assert ahead.returncode == 2
    assert message in ahead.stderr
    assert not (tmp_path / "s.db").exists()


def test_no_copy_is_made_where_it_is_of_no_use(tmp_path: Path) -> None:
    before = children()
    (tmp_path / "there.db").touch()
    for store, jobs in (("there.db", 2), ("s.db", 1)):
        with programs_ahead(tmp_path / store, jobs) as programs:
            assert programs is None
            assert children() == before
