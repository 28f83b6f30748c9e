"""The sweeps that a cross-check reads: every experiment in multibody and in MuJoCo, its first samples in variants.

What is alike on both sides is swept in the side view too.

Input: a study, a simulator for each engine. Output: rows in the store.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ELLIPSOID, HALF_STEP, MUJOCO, MULTIBODY, SIDE_VIEW
from foldcar.study.environments import Environment
from foldcar.study.experiment_runs import Progress
from foldcar.study.experiments import Study, engine_study
from foldcar.study.sweep import Sweep
from foldcar.study.unlike_sides import unlike_sides

# Those of the baseline show how far MuJoCo agrees with itself.
EVERY, BASELINE = (MULTIBODY, MUJOCO, SIDE_VIEW), (HALF_STEP, ELLIPSOID)


class Bar(Protocol):
    """What shows a sweep's progress."""

    def update(self, progress: Progress) -> None:
        """Display the counts."""

    def say(self, line: str) -> None:
        """Display a line."""


def simulators(baseline: int) -> dict[str, Carsim]:
    """A simulator for each engine that is asked; CarsimError if one is missing."""
    return {engine: Carsim(engine=engine) for engine in (*EVERY, *(BASELINE if baseline else ()))}


def check_success(study: Study) -> None:
    """FoldcarError if an experiment does not define when a run has passed."""
    for experiment in study.experiments:
        success = Environment(experiment).success
        if not success.defined:
            raise FoldcarError(f"{experiment.place}: engines are compared by success, and {success.text}")


def sweep_all(
    study: Study,
    store: Path,
    carsims: Mapping[str, Carsim],
    baseline: int,
    jobs: int,
    command: str,
    bar_of: Callable[[Progress, str], AbstractContextManager[Bar]],
) -> None:
    """Simulate with each engine what the store lacks; ``bar_of`` shows that of an engine, by its key. FoldcarError."""
    for engine, part in _parts(study, baseline, carsims):
        if not part.experiments:
            continue
        asked = Sweep(part, store, carsims[engine], command)
        with bar_of(asked.progress, engine) as bar:
            # What holds for the listing is said once.
            say = bar.say if engine == MULTIBODY else lambda line: None
            asked.run(jobs, bar.update, say)


def _parts(study: Study, baseline: int, carsims: Mapping[str, Carsim]) -> Iterator[tuple[str, Study]]:
    few = replace(
        study,
        experiments=tuple(replace(one, environments=min(one.environments, baseline)) for one in study.experiments),
    )
    for engine, carsim in carsims.items():
        part = few if engine in BASELINE else study
        if engine == SIDE_VIEW:
            alike = (one for one in study.experiments if not unlike_sides(carsim, one, Environment(one)))
            part = replace(study, experiments=tuple(alike))
        yield engine, engine_study(part, carsim)
