"""An experiment's environment: its scenes, the nearby cars that meet them, and what simulates them.

Compiling a program takes most of a second: it is done when first needed, and not at all where a store knows
the answers.
"""

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from foldcar.car.variation.spread import draw
from foldcar.scenes.fingerprint import environment_fingerprint, spread_fingerprint, variation_code
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import Runner
from foldcar.study.experiments import Experiment

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource
    from foldcar.simulation.scenic_runner import ScenicRunner

# The spread of cars that are all as designed.
NOMINAL = "nominal"


class Environment:
    """The environment of one experiment. All methods raise FoldcarError if the program is at fault."""

    def __init__(self, experiment: Experiment) -> None:
        e = self._experiment = experiment
        self._source: SceneSource | None = None
        self.fingerprint = environment_fingerprint(e.program, e.scenic_params, e.seed, e.condition)
        self.spread_fingerprint = (
            spread_fingerprint(e.variation, e.variation_seed) if e.variation else NOMINAL
        )

    @property
    def dynamic(self) -> bool:
        """Whether the program has to run beside the simulation, to decide or record while the car drives."""
        return self._open().dynamic

    def sample(self, k: int) -> dict[str, Any]:
        """Sample ``k`` as a scene object of docs/carsim.md without its id."""
        return self._open().sample(k)

    def scene_identity(self, k: int, dynamic: bool) -> str:
        """What tells a scene from others that look the same: a dynamic program knows more than they show."""
        return f"{self.fingerprint}/{k}" if dynamic else ""

    def variation(self, k: int) -> dict[str, Any]:
        """How the cars of sample ``k`` differ from their designs; empty if they do not."""
        e = self._experiment
        return draw(e.variation, e.variation_seed, k) if e.variation else {}

    def variation_identity(self) -> str:
        """What tells a variation from others of the same numbers: the code that applies them."""
        return variation_code() if self._experiment.variation else ""

    @contextlib.contextmanager
    def runner(self, carsim: Carsim, dynamic: bool) -> Iterator[Runner]:
        """What simulates runs of this environment."""
        if not dynamic:
            yield carsim
            return
        with contextlib.closing(self.scenic_runner(carsim)) as runner:
            yield runner

    def scenic_runner(self, carsim: Carsim, **options: Any) -> "ScenicRunner":
        """Scenic beside the simulation; ``options`` are ScenicRunner's. To be closed."""
        from foldcar.simulation.scenic_runner import ScenicRunner

        e = self._experiment
        return ScenicRunner(e.program, e.scenic_params, e.seed, e.condition, carsim.binary, **options)

    def _open(self) -> "SceneSource":
        from foldcar.scenes.source import open_environment

        if self._source is None:
            e = self._experiment
            self._source = open_environment(e.program, dict(e.scenic_params), e.seed, e.condition)
        return self._source
