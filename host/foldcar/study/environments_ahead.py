"""An environment whose program another process compiles and samples (see simulation/programs_ahead.py).

Input: an experiment. Output: what Environment gives, errors too. Without the other process this one compiles the program.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from foldcar.scenes.program_files import Files
from foldcar.scenes.success import SuccessRule
from foldcar.simulation.programs_ahead import Opening, ProgramsAhead
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment


def environments_ahead(experiments: Sequence[Experiment], programs: ProgramsAhead) -> dict[str, Environment]:
    """The experiments' environments by their ids; ``programs`` compiles from now on."""
    programs.prepare([_opening(one) for one in experiments])
    return {one.id: EnvironmentAhead(one, programs) for one in experiments}


class EnvironmentAhead(Environment):
    """The environment of one experiment."""

    def __init__(self, experiment: Experiment, programs: ProgramsAhead) -> None:
        super().__init__(experiment)
        self._programs, self._opening = programs, _opening(experiment)

    @property
    def dynamic(self) -> bool:
        """Whether the program has parts that Scenic must evaluate during a simulation."""
        return super().dynamic if self._facts is None else bool(self._facts["dynamic"])

    @property
    def success(self) -> SuccessRule:
        """When a run of the program has passed; without the conditions' names."""
        return super().success if self._facts is None else SuccessRule(self._facts["defined"], self._facts["text"])

    def sample(self, k: int) -> dict[str, Any]:
        """Sample ``k`` as a scene object of docs/carsim.md, without id."""
        scene = self._programs.ask("scene", self._opening, k)
        return super().sample(k) if scene is None else scene

    @cached_property
    def _facts(self) -> Any:
        return self._programs.ask("facts", self._opening)

    def _known_files(self) -> Files | None:
        files: Files | None = None if self._facts is None else self._facts["files"]
        return files

    def _mutation_notes(self) -> list[str]:
        notes = self._programs.ask("notes", self._opening)
        return super()._mutation_notes() if notes is None else notes


def _opening(experiment: Experiment) -> Opening:
    e = experiment
    return {
        "program": str(e.program),
        "params": dict(e.scenic_params),
        "seed": e.seed,
        "condition": None if e.condition is None else dict(e.condition),
    }
