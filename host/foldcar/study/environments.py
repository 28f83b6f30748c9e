"""The environment of one experiment: its scenes, its built cars' variations, and the runner of its simulations.

Input: an experiment. Output: scenes (sampled by scenes/source.py), variations, fingerprints, a runner. The Scenic program
is compiled only when it is needed, because that takes almost a second; not at all if the store has all results.
"""

import contextlib
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

from foldcar.car.variation import draw
from foldcar.scenes.fingerprint import environment_fingerprint, spread_fingerprint, variation_code
from foldcar.scenes.fixed_hash import open_fixed_environment
from foldcar.scenes.object_names import Parameters
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.program_files import Files, ProgramFiles
from foldcar.scenes.scene_notes import ALIKE, EARLY_DRAW, scene_notes
from foldcar.scenes.source import SceneSource
from foldcar.scenes.success import SuccessRule
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import Runner
from foldcar.simulation.scenic_runner import ScenicRunner
from foldcar.study.experiments import Experiment

# The fingerprint of a spread if cars do not vary.
NOMINAL = "nominal"


class ExperimentEnvironment:
    """The environment of one experiment. All methods raise FoldcarError if the Scenic program has an error."""

    def __init__(self, experiment: Experiment) -> None:
        self._experiment = experiment
        self._source: SceneSource | None = None
        # The program's files as an earlier sweep has stored them, if none of them has changed since (see recall).
        self._recalled: Files | None = None
        # The environment's fingerprint if it were simulated in the nominal reality; None if it is.
        self.nominal_fingerprint: str | None = None
        # Identifies how the built cars of a design differ from each other.
        self.spread_fingerprint = NOMINAL
        if experiment.variation:
            self.spread_fingerprint = spread_fingerprint(experiment.variation, experiment.variation_seed)

    @cached_property
    def fingerprint(self) -> str:
        """The hash that identifies the environment in the store."""
        return self._fingerprint_of(self.files)

    def _fingerprint_of(self, files: Files) -> str:
        """Return the environment's hash if its program has these files."""
        experiment = self._experiment
        return environment_fingerprint(
            experiment.program, files, experiment.scenic_params, experiment.seed, experiment.condition
        )

    @property
    def files(self) -> Files:
        """The program's files."""
        return self._open().fixed_files() if self._recalled is None else self._recalled

    def recall(self, files: Files | None, is_known: Callable[[str], bool]) -> None:
        """Reuse the program's ``files`` of an earlier sweep, which saves compiling the program.

        They are reused only if none has changed, and if ``is_known`` finds their fingerprint in the store.
        """
        if files is None or self._source is not None or not ProgramFiles(self.program, files).unchanged():
            return
        if is_known(self._fingerprint_of(files)):
            self._recalled = files

    @property
    def program(self) -> Path:
        """The Scenic program."""
        return self._experiment.program

    @property
    def reality(self) -> dict[str, str] | None:
        """The reality to simulate in, as in ExperimentInfo; None if the simulator is nominal."""
        return None

    @property
    def dynamic(self) -> bool:
        """Whether the program has parts that Scenic must evaluate during a simulation."""
        return self._open().dynamic

    @property
    def needs_scenic(self) -> str:
        """What Scenic must evaluate during a simulation, with its line in the program; "" if nothing."""
        return self._open().needs_scenic

    @property
    def success(self) -> SuccessRule:
        """The rule that says when a run has passed."""
        return self._open().success

    def notes(self) -> list[str]:
        """Return remarks on what the author of the program probably did not mean.

        A program that an earlier sweep has sampled is not compiled again for its remarks, and so gets none.
        """
        if self._source is None:
            return []
        scene = self.sample(0)
        notes = [f"sample 0: {note}" for note in scene_notes(scene)]
        if self._source.has_drawn_early:
            # Random values that are drawn while the program is compiled are the same in all samples.
            notes.append(EARLY_DRAW)
        experiment = self._experiment
        # The cars of all samples are alike without variation. If the scenes are alike as well, so are the runs.
        has_equal_cars = not experiment.variation
        if experiment.environments > 1 and has_equal_cars and self.sample(1) == scene:
            notes.append(ALIKE)
        return notes

    @property
    def terrain_objects(self) -> list[tuple[str, int]]:
        """The name of each terrain object and its number of pieces, in the order of sample 0's terrain."""
        return self._open().terrain_objects()

    def sample(self, k: int) -> dict[str, Any]:
        """Return sample ``k`` as a scene object of docs/carsim.md, without id."""
        return self._fixed().sample(k)

    def sample_with_parameters(self, k: int) -> tuple[dict[str, Any], list[Parameters]]:
        """Return sample ``k``, and the name and the parameters of each terrain object."""
        return self._fixed().sample_with_parameters(k)

    def sample_with_obstacles(self, k: int) -> tuple[dict[str, Any], list[Obstacle]]:
        """Return sample ``k``, and the obstacles of its terrain, which stand on the floor."""
        return self._fixed().sample_with_obstacles(k)

    def variation(self, k: int) -> dict[str, Any]:
        """Draw how the cars of sample ``k`` differ from their designs; empty without variation."""
        experiment = self._experiment
        return draw(experiment.variation, experiment.variation_seed, k) if experiment.variation else {}

    def variation_identity(self) -> str:
        """Return the hash of the code that applies variations, which identifies them in the store."""
        return variation_code() if self._experiment.variation else ""

    @contextlib.contextmanager
    def runner(self, carsim: Carsim, dynamic: bool) -> Iterator[Runner]:
        """Yield what simulates runs in this environment: carsim or, if the program is dynamic, Scenic beside carsim.

        A dynamic program has parts that only Scenic can evaluate during a run.
        """
        if not dynamic:
            yield carsim
            return
        experiment = self._experiment
        scenic = ScenicRunner(
            experiment.program,
            experiment.scenic_params,
            experiment.seed,
            experiment.condition,
            self.files,
            carsim.command,
        )
        with contextlib.closing(scenic) as runner:
            yield runner

    def _open(self) -> SceneSource:
        """Return the source of scenes; compile the program at the first call.

        The program's files are those that an earlier sweep has stored, if they have not changed.
        """
        if self._source is None:
            experiment = self._experiment
            self._source = open_fixed_environment(
                experiment.program,
                dict(experiment.scenic_params),
                experiment.seed,
                experiment.condition,
                self._recalled,
            )
        return self._source

    def _fixed(self) -> SceneSource:
        """Return the source of scenes after it has drawn sample 0, because the program may read files only then."""
        source = self._open()
        source.fixed_files()
        return source
