"""Which design to try next: an Optuna study of a family.

Each parameter is the place of its value among the family's in ascending order. What is told of a design: its objectives,
or that it cannot be built. Equal seeds give equal proposals, so that a search that was cut short goes the same way again,
and finds its runs in the store.
"""

import itertools
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
from foldcar.study.search.design_simulator import Row, Values
from foldcar.study.search.objectives import Objective, beaten

# Generations of NSGA-II: of Optuna's default of 50, a search of some hundred designs would see two.
POPULATION = 16
# After so many proposals in a row that are known, a design is drawn from those that are not.
MAX_REPEATS = 8
DRAWS = 2000
# The probability, over all looks together, that a design is left early that would end as good as the best, or better.
PRUNING_RISK = 0.1
# Optuna's constraint: met at 0, violated above.
BUILDABLE = "buildable"


@dataclass(frozen=True)
class Tried:
    """A design that was tried. ``objectives`` are its values over ``environments`` samples; ``pruned`` if not in all.

    ``mean_time_s`` is the objective "time" over them, which decides between equals.
    """

    values: Values
    objectives: tuple[float, ...]
    environments: int
    pruned: bool
    mean_time_s: float


class Proposals:
    """The study: ask for designs that were not tried, tell what they are worth. ``designs`` are the points of a grid."""

    def __init__(self, family: Family, objectives: Sequence[Objective], sampler: str, seed: int, designs: int) -> None:
        self._family = family
        self._objectives = objectives
        self._seed = seed
        self._levels = {key: sorted(values) for key, values in family.choices.items()}
        self._varied = [key for key, levels in self._levels.items() if len(levels) > 1]
        if not self._varied:
            raise FoldcarError(f"{family.file}: {family.place}: has one design only: nothing to search for")
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        self._sampler = sampler
        self._study = optuna.create_study(
            directions=["maximize" if objective.largest else "minimize" for objective in objectives]
        )
        self._grid = [] if sampler != "grid" else grid([len(self._levels[key]) for key in self._varied], designs)
        self._left = iter(self._grid)
        self._trial: Trial | None = None
        self._suggested: Values = ()
        # The loss of the best design that was tried in all environments, and its rows.
        self._best: tuple[float, Sequence[Row]] | None = None
        self.tried: list[Tried] = []
        self.unbuildable: dict[Values, str] = {}

    def next(self) -> Values | None:
        """A design that can be built and was not tried; None if no more is found. It must be told of."""
        known = {*(one.values for one in self.tried), *self.unbuildable}
        repeats = 0
        while True:
            places = next(self._left, None)
            if self._grid and places is None:
                return None
            if places is not None:
                self._study.enqueue_trial(dict(zip(self._varied, places, strict=True)))
            elif repeats >= MAX_REPEATS:
                if not self._queue_unknown(known):
                    return None
                repeats = 0
            self._study.sampler = self._sampler_of(len(self._study.get_trials(deepcopy=False)))
            self._trial = trial = self._study.ask()
            suggested = {key: trial.suggest_int(key, 0, len(self._levels[key]) - 1) for key in self._varied}
            self._suggested = values = self._values(suggested)
            if values in known:
                # Told once more, it would count twice.
                self._study.tell(trial, state=TrialState.FAIL)
            elif (error := self._family.error(values)) is None:
                return values
            else:
                self.refuse(str(error))
                known.add(values)
            repeats += 1

    def worse(self, rows: Sequence[Row], limit_s: float) -> bool:
        """Whether the design under trial is worse than the best by its ``rows`` so far, in the order of environments.

        Of the designs that would end as good as the best in all environments, or better, at most PRUNING_RISK are called
        worse, over all looks (:func:`evidence_of_worse`). The best was chosen by all its runs, which their order, being
        random, does not tell.
        """
        if self._best is None or not math.isfinite(self._best[0]):
            return False
        excess, most_better = self._objectives[0].excess(rows, self._best[1], limit_s)
        return evidence_of_worse(excess, len(self._best[1]), most_better) >= 1 / PRUNING_RISK

    def refuse(self, reason: str) -> None:
        """The design under trial has no worth, for a reason that holds whenever it is tried."""
        assert self._trial is not None
        self.unbuildable[self._suggested] = reason
        self._trial.set_constraint(BUILDABLE, 1.0)
        self._study.tell(self._trial, state=TrialState.PRUNED)

    def tell(self, objectives: Sequence[float], rows: Sequence[Row], pruned: bool, mean_time_s: float) -> None:
        """What the design under trial is worth, as Tried has it; ``rows`` as :meth:`worse`."""
        assert self._trial is not None
        self._trial.set_constraint(BUILDABLE, 0.0)
        self._study.tell(self._trial, list(objectives))
        loss = -objectives[0] if self._objectives[0].largest else objectives[0]
        if not pruned and (self._best is None or loss < self._best[0]):
            self._best = loss, rows
        self.tried.append(Tried(self._suggested, tuple(objectives), len(rows), pruned, mean_time_s))

    def best(self, count: int) -> list[Tried]:
        """The best ``count`` of those tried in all environments; with several objectives, those none beats in all."""
        signs = np.array([-1 if objective.largest else 1 for objective in self._objectives])
        found = [(tuple(signs * one.objectives), one) for one in self.tried if not one.pruned]
        every = [losses for losses, _ in found]
        front = [(losses, one) for losses, one in found if len(signs) == 1 or not beaten(losses, every)]
        return [one for _, one in sorted(front, key=lambda pair: (pair[0], pair[1].mean_time_s))[:count]]

    def _values(self, places: dict[str, int]) -> Values:
        return tuple(levels[places.get(key, 0)] for key, levels in self._levels.items())

    def _sampler_of(self, number: int) -> Any:
        seed = (self._seed * 1_000_003 + number) % 2**32
        if self._sampler == "tpe":
            return optuna.samplers.TPESampler(seed=seed, multivariate=True)
        if self._sampler == "nsga2":
            return optuna.samplers.NSGAIISampler(seed=seed, population_size=POPULATION)
        return optuna.samplers.RandomSampler(seed=seed)

    def _queue_unknown(self, known: set[Values]) -> bool:
        """Let a design that is not known be the next proposal; False if none is found."""
        draw = random.Random(f"{self._seed}/{len(known)}")
        for _ in range(DRAWS):
            places = {key: draw.randrange(len(self._levels[key])) for key in self._varied}
            values = self._values(places)
            if values not in known and self._family.error(values) is None:
                self._study.enqueue_trial(places)
                return True
        return False


def grid(levels: Sequence[int], points: int) -> list[tuple[int, ...]]:
    """At most ``points`` places in evenly spaced values of parameters, which are divided alike as far as possible."""
    counts = [1] * len(levels)

    def fits(axis: int) -> bool:
        more = counts[axis] + 1
        return more <= levels[axis] and math.prod(counts) // counts[axis] * more <= points

    while axes := [axis for axis in range(len(levels)) if fits(axis)]:
        counts[min(axes, key=lambda axis: counts[axis] / levels[axis])] += 1
    # The middles of equal parts.
    places = [
        [(2 * i + 1) * level // (2 * count) for i in range(count)] for level, count in zip(levels, counts, strict=True)
    ]
    return list(itertools.product(*places))
