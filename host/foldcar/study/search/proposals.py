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

import optuna
from optuna.trial import Trial, TrialState

from foldcar.errors import FoldcarError
from foldcar.statistics.stopping import evidence_of_worse
from foldcar.study.family import Family
from foldcar.study.search.design_simulator import RunRow, Values
from foldcar.study.search.objectives import Objective, is_dominated

# After this many successive proposals of designs that were proposed before or cannot be built, a new design is drawn at
# random, in at most DRAWS attempts.
MAX_REPEATS = 8
DRAWS = 2000
# Probability, over all interim checks, that pruning stops a design that would be at least as good as the best.
PRUNING_RISK = 0.1
# The evidence (see evidence_of_worse) at which a design is pruned.
MIN_EVIDENCE = 1 / PRUNING_RISK
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
            directions=["maximize" if objective.is_maximised else "minimize" for objective in objectives]
        )
        # The proposal whose result is awaited: Optuna's trial, and the design.
        self._trial: Trial | None = None
        self._suggested: Values = ()
        # Loss and rows of the best design that was tried in all environments.
        self._best: tuple[float, Sequence[RunRow]] | None = None
        self.tried: list[Tried] = []
        self.unbuildable: dict[Values, str] = {}

    def next(self) -> Values | None:
        """Return a buildable design that was not tried before, or None if none is left.

        Pass its result to :meth:`tell`, or to :meth:`refuse`, before the next call.
        """
        seen = {tried.values for tried in self.tried}
        seen.update(self.unbuildable)
        failed_proposals = 0
        while True:
            if failed_proposals == MAX_REPEATS:
                # The sampler proposes the same designs again and again, so a random new design takes its turn.
                if not self._enqueue_new_design(seen):
                    return None
                failed_proposals = 0
            values = self._ask()
            if values in seen:
                # The design's result is known. If the study got it again, it would count twice.
                assert self._trial is not None
                self._study.tell(self._trial, state=TrialState.FAIL)
                failed_proposals += 1
                continue
            error = self._family.error(values)
            if error is None:
                return values
            self.refuse(str(error))
            seen.add(values)
            failed_proposals += 1

    def _ask(self) -> Values:
        """Return the design that Optuna proposes next. It may be one that was tried, or that cannot be built."""
        # Each proposal has a sampler of its own, so that a resumed search repeats the same proposals.
        self._study.sampler = self._sampler_of(len(self._study.get_trials(deepcopy=False)))
        trial = self._study.ask()
        indices = {key: trial.suggest_int(key, 0, len(self._levels[key]) - 1) for key in self._varied}
        self._trial = trial
        self._suggested = self._values(indices)
        return self._suggested

    def is_worse(self, rows: Sequence[RunRow], limit_s: float) -> bool:
        """Return whether the proposed design is probably worse than the best design so far.

        ``rows`` are its results so far, in the order of the environments. The search asks after every batch of
        environments. A design that is in truth at least as good as the best one is called worse in any of these checks
        with a probability of at most PRUNING_RISK. This is shown at :func:`evidence_of_worse`; it needs a random order of
        the environments.
        """
        if self._best is None:
            return False
        best_loss, best_rows = self._best
        # A difference from an infinite loss cannot be computed.
        if not math.isfinite(best_loss):
            return False
        losses = self._objectives[0].compare(rows, best_rows, limit_s)
        evidence = evidence_of_worse(losses.differences, len(best_rows), losses.max_gain)
        return evidence >= MIN_EVIDENCE

    def refuse(self, reason: str) -> None:
        """Record why the proposed design has no result, so that it is not proposed again."""
        assert self._trial is not None
        self.unbuildable[self._suggested] = reason
        self._trial.set_constraint(BUILDABLE, 1.0)
        self._study.tell(self._trial, state=TrialState.PRUNED)

    def tell(self, objectives: Sequence[float], rows: Sequence[RunRow], pruned: bool, mean_time_s: float) -> None:
        """Record the result of the proposed design.

        ``objectives`` has a value for each objective of the search. ``rows`` are the design's results in the order of the
        environments. If it was ``pruned``, it was stopped early, so these are the results of the first environments only.
        ``mean_time_s`` decides between designs with equal objectives.
        """
        assert self._trial is not None
        # For Optuna, a constraint is met if its value is at most 0.
        self._trial.set_constraint(BUILDABLE, 0.0)
        self._study.tell(self._trial, list(objectives))
        # The best design is the one with the least loss in the first objective.
        loss = self._objectives[0].loss(objectives[0])
        is_best = self._best is None or loss < self._best[0]
        if is_best and not pruned:
            self._best = loss, rows
        self.tried.append(Tried(self._suggested, tuple(objectives), len(rows), pruned, mean_time_s))

    def best(self, count: int) -> list[Tried]:
        """Return the best ``count`` of the tried designs, best first.

        Designs that were pruned, which means stopped before they were tried in all environments, are not among them.
        With several objectives, these are non-dominated designs: no design is better in one objective and as good in the
        others. They are in the order of the first objective.
        """
        candidates = [tried for tried in self.tried if not tried.pruned]
        if len(self._objectives) > 1:
            all_losses = [self._losses(tried) for tried in candidates]
            candidates = [tried for tried in candidates if not is_dominated(self._losses(tried), all_losses)]
        candidates.sort(key=lambda tried: (self._losses(tried), tried.mean_time_s))
        return candidates[:count]

    def _losses(self, tried: Tried) -> tuple[float, ...]:
        """Return a design's objectives with the sign that makes smaller values better."""
        losses = []
        for objective, value in zip(self._objectives, tried.objectives, strict=True):
            losses.append(objective.loss(value))
        return tuple(losses)

    def _values(self, indices: dict[str, int]) -> Values:
        """Return the design whose varied parameters have the values with these indices."""
        return tuple(levels[indices.get(key, 0)] for key, levels in self._levels.items())

    def _sampler_of(self, number: int) -> Any:
        """Return a new sampler for proposal ``number``. Its seed follows from the number, so a search can be repeated."""
        return optuna.samplers.TPESampler(seed=(self._seed * 1_000_003 + number) % 2**32, multivariate=True)

    def _enqueue_new_design(self, seen: set[Values]) -> bool:
        """Make a random buildable design that is not in ``seen`` the next proposal.

        Return False if DRAWS random designs were all in ``seen`` or unbuildable.
        """
        draw = random.Random(f"{self._seed}/{len(seen)}")
        for _ in range(DRAWS):
            indices = {key: draw.randrange(len(self._levels[key])) for key in self._varied}
            values = self._values(indices)
            if values not in seen and self._family.error(values) is None:
                self._study.enqueue_trial(indices)
                return True
        return False
