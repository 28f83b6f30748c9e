"""What runs chunks of runs: carsim's batch, or Scenic beside carsim. The interface of both."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from foldcar.errors import FoldcarError

# Between the rows of a path that is drawn.
PATH_INTERVAL_S = 0.02


class CarsimError(FoldcarError):
    """The simulator is missing, broke down, or refused what it was given."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """One run: keys of the chunk's bodies and scenes, the settings as a JSON object, a name for errors.

    ``sample`` is the sample of the environment that the scene is.
    """

    body: str
    scene: str
    settings: str
    label: str
    sample: int


class Runner(Protocol):
    """Runs chunks. Called from several threads at once.

    A process that dies takes only its run with it: that run is simulated once more in a new process, and has failed
    if it dies again.
    """

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers to ``requests`` in order; ``{"error": message}`` for a run that failed. FoldcarError.

        ``bodies`` and ``scenes`` map ids to JSON objects as text.
        """

    def stop(self) -> None:
        """End what runs at the moment; its `run` raises FoldcarError."""
