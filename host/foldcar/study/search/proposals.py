"""Proposes the next design to try, by an Optuna study of a family.

Each parameter of the study is the index of a value among the family's values in ascending order. The study gets a
design's objectives, or the fact that it cannot be built. Equal seeds give equal proposals: an interrupted search repeats
the same proposals and finds their runs in the store.
"""

import math
import random
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
from optuna.trial import Trial, TrialState

from foldcar.errors import FoldcarError
from foldcar.statistics.stopping import evidence_of_worse
from foldcar.study.family import Family
from foldcar.study.search.design_simulator import RunRow, Values
from foldcar.study.search.objectives import Objective, is_dominated

# After this many successive proposals of designs that were proposed before, a new design is drawn at random, in at most
# DRAWS attempts.
MAX_REPEATS = 8
DRAWS = 2000
# Probability, over all interim checks, that pruning stops a design that would be at least as good as the best.
PRUNING_RISK = 0.1
# Name of Optuna's constraint; it is met at 0 and violated above.
BUILDABLE = "buildable"


@dataclass(frozen=True)
class Tried:
    """A design that was tried: its ``objectives`` over the first ``environments`` samples.

    ``pruned`` is whether it was stopped before all samples. ``mean_time_s`` is the objective "time", which breaks ties.
    """

    values: Values
    objectives: tuple[float, ...]
    environments: int
    pruned: bool
    mean_time_s: float


class Proposals:
    """An Optuna study of a family: :meth:`next` proposes an untried design, :meth:`tell` takes its result.

    Designs are proposed by a tree-structured Parzen estimator (TPE) with the random ``seed``.
    """

    def __init__(self, family: Family, objectives: Sequence[Objective], seed: int = 0) -> None:
        self._family = family
        self._objectives = objectives
        self._seed = seed
        self._levels = {key: sorted(values) for key, values in family.choices.items()}
        self._varied = [key for key, levels in self._levels.items() if len(levels) > 1]
        if not self._varied:
            raise FoldcarError(f"{family.file}: {family.place}: has only one design, so there is nothing to search for")
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        # Optuna warns of each option that may still change, such as multivariate TPE.
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        self._study = optuna.create_study(
            directions=["maximize" if objective.largest else "minimize" for objective in objectives]
        )
        # The proposal whose result is awaited: Optuna's trial, and the design.
        self._trial: Trial | None = None
        self._suggested: Values = ()
        # Loss and rows of the best design that was tried in all environments.
        self._best: tuple[float, Sequence[RunRow]] | None = None
        self.tried: list[Tried] = []
        self.unbuildable: dict[Values, str] = {}

    def next(self) -> Values | None:
        """Return an untried design that can be built, or None if there is no more. Pass its result to :meth:`tell`."""
        seen = {*(tried.values for tried in self.tried), *self.unbuildable}
        repeats = 0
        while True:
            if repeats >= MAX_REPEATS:
                # The sampler repeats itself: draw a new design without it.
                if not self._enqueue_new_design(seen):
                    return None
                repeats = 0
            # A sampler of its own for each proposal, so that a resumed search repeats the same proposals.
            self._study.sampler = self._sampler_of(len(self._study.get_trials(deepcopy=False)))
            self._trial = trial = self._study.ask()
            indices = {key: trial.suggest_int(key, 0, len(self._levels[key]) - 1) for key in self._varied}
            self._suggested = values = self._values(indices)
            if values in seen:
                # A second result of the design would count twice.
                self._study.tell(trial, state=TrialState.FAIL)
            elif (error := self._family.error(values)) is None:
                return values
            else:
                self.refuse(str(error))
                seen.add(values)
            repeats += 1

    def is_worse(self, rows: Sequence[RunRow], limit_s: float) -> bool:
        """Return whether the proposed design is worse than the best design, judged by its ``rows`` so far.

        Rows are in the order of environments. The probability that a design is called worse in any check, although over
        all environments it is at least as good as the best, is at most PRUNING_RISK (:func:`evidence_of_worse`). This
        holds although the best was chosen by all its runs, because their order is random.
        """
        if self._best is None:
            return False
        best_loss, best_rows = self._best
        # An infinite loss has no finite excess over it.
        if not math.isfinite(best_loss):
            return False
        excess, max_gain = self._objectives[0].excess(rows, best_rows, limit_s)
        return evidence_of_worse(excess, len(best_rows), max_gain) >= 1 / PRUNING_RISK

    def refuse(self, reason: str) -> None:
        """Record that the proposed design can have no result, with the reason, so that it is not proposed again."""
        assert self._trial is not None
        self.unbuildable[self._suggested] = reason
        self._trial.set_constraint(BUILDABLE, 1.0)
        self._study.tell(self._trial, state=TrialState.PRUNED)

    def tell(self, objectives: Sequence[float], rows: Sequence[RunRow], pruned: bool, mean_time_s: float) -> None:
        """Record the result of the proposed design (see Tried); ``rows`` as in :meth:`is_worse`."""
        assert self._trial is not None
        # 0: the constraint is met, the design can be built.
        self._trial.set_constraint(BUILDABLE, 0.0)
        self._study.tell(self._trial, list(objectives))
        loss = -objectives[0] if self._objectives[0].largest else objectives[0]
        if not pruned and (self._best is None or loss < self._best[0]):
            self._best = loss, rows
        self.tried.append(Tried(self._suggested, tuple(objectives), len(rows), pruned, mean_time_s))

    def best(self, count: int) -> list[Tried]:
        """Return the best ``count`` designs tried in all environments; with several objectives, non-dominated ones."""
        signs = np.array([-1 if objective.largest else 1 for objective in self._objectives])
        losses_and_designs = [(tuple(signs * tried.objectives), tried) for tried in self.tried if not tried.pruned]
        all_losses = [losses for losses, _ in losses_and_designs]
        front = [
            (losses, tried)
            for losses, tried in losses_and_designs
            if len(signs) == 1 or not is_dominated(losses, all_losses)
        ]
        return [tried for _, tried in sorted(front, key=lambda pair: (pair[0], pair[1].mean_time_s))[:count]]

    def _values(self, indices: dict[str, int]) -> Values:
        """Return a design's values from the indices of its varied parameters' values."""
        return tuple(levels[indices.get(key, 0)] for key, levels in self._levels.items())

    def _sampler_of(self, number: int) -> Any:
        """Return a new sampler for proposal ``number``, with a seed of its own, so that a resumed search repeats it."""
        return optuna.samplers.TPESampler(seed=(self._seed * 1_000_003 + number) % 2**32, multivariate=True)

    def _enqueue_new_design(self, seen: set[Values]) -> bool:
        """Make a random buildable design that is not in ``seen`` the next proposal; return False after DRAWS failures."""
        draw = random.Random(f"{self._seed}/{len(seen)}")
        for _ in range(DRAWS):
            indices = {key: draw.randrange(len(self._levels[key])) for key in self._varied}
            values = self._values(indices)
            if values not in seen and self._family.error(values) is None:
                self._study.enqueue_trial(indices)
                return True
        return False
