"""How a report gets its replays: which simulator, how many at once, who is told of the progress.

Input: an experiment of a store. Output: its replay, or the reason why there is none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from foldcar.replay.outcome_grid import OutcomeGrid
from foldcar.replay.replay import Replay, make_replay
from foldcar.simulation.carsim import Carsim
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial


@dataclass(frozen=True)
class Replayer:
    """``carsim`` gives the simulator with an engine, or why there is none; ``plan`` and ``done`` hear of steps."""

    carsim: Callable[[str], Carsim | str]
    jobs: int = 1
    plan: Callable[[int], None] = lambda steps: None
    done: Callable[[int], None] = lambda steps: None

    def replay(self, store: Store, info: ExperimentInfo, grid: OutcomeGrid, trials: Sequence[Trial]) -> Replay:
        """The replay of an experiment. FoldcarError if the simulator breaks down."""
        return make_replay(store, info, grid, trials, self.carsim(info.engine), self.jobs, self.done, self.plan)
