"""Which design to try next: an Optuna study of a family, kept in a file beside the store.

Each parameter is the place of its value among the family's in ascending order. What is told of a design: its objectives,
or that it cannot be built. A search that was cut short goes on as if it had not been: the sampler of each proposal has a
seed of its own, and a design that was being tried is tried first.
"""

import hashlib
import itertools
import json
import math
import random
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend
from optuna.trial import FrozenTrial, Trial, TrialState

from foldcar.errors import FoldcarError
from foldcar.interrupts import delayed
from foldcar.search.design_simulator import Values
from foldcar.search.objectives import Objective
from foldcar.study.family import Family

# Generations of NSGA-II: of Optuna's default of 50, a search of some hundred designs would see two.
POPULATION = 16
# After so many proposals in a row that are known, a design is drawn from those that are not.
MOST_REPEATS = 8
DRAWS = 2000
PRUNING_RISK = 0.1
LEAST_LOOKS = 2
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
    """The study: ask for designs that were not tried, tell what they are worth."""

    def __init__(
        self,
        file: Path,
        family: Family,
        objectives: Sequence[Objective],
        sampler: str,
        seed: int,
        identity: object,
        designs: int,
    ) -> None:
        """``identity`` is what else the designs' worth depends on, as JSON; ``designs`` are the points of a grid."""
        self._family = family
        self._objectives = objectives
        self._sampler_name = sampler
        self._seed = seed
        self._levels = {key: sorted(values) for key, values in family.choices.items()}
        self._varied = [key for key, levels in self._levels.items() if len(levels) > 1]
        if not self._varied:
            raise FoldcarError(f"{family.file}: {family.place}: has one design only: nothing to search for")
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        space = [family.vehicle_type, list(self._levels.items()), identity]
        # A grid is laid out for its number of designs.
        kind = f"grid of {designs}" if sampler == "grid" else sampler
        digest = hashlib.sha256(json.dumps(space).encode()).hexdigest()[:12]
        name = f"{' '.join(one.name for one in objectives)}, {kind}, seed {seed}, {digest}"
        with delayed():
            self._study = optuna.create_study(
                storage=JournalStorage(JournalFileBackend(str(file))),
                study_name=name,
                directions=["maximize" if one.largest else "minimize" for one in objectives],
                load_if_exists=True,
                pruner=_PairedPruner(),
            )
            self._grid = [] if sampler != "grid" else grid([len(self._levels[key]) for key in self._varied], designs)
        self._trial: Trial | None = None

    def tried(self) -> list[Tried]:
        """The designs that were tried, in their order."""
        return [_tried(self._values(trial), trial) for trial in self._study.get_trials(states=(TrialState.COMPLETE,))]

    def unbuildable(self) -> dict[Values, str]:
        """The designs that cannot be built, or have no worth, with the reasons."""
        pruned = self._study.get_trials(states=(TrialState.PRUNED,))
        return {self._values(trial): trial.user_attrs["unbuildable"] for trial in pruned}

    def next(self) -> Values | None:
        """A design that can be built and was not tried; None if no more is found. It must be told of."""
        known = {one.values for one in self.tried()} | set(self.unbuildable())
        repeats = 0
        while not self._grid_is_tried():
            if repeats >= MOST_REPEATS and not self._grid:
                if not self._queue_unknown(known):
                    return None
                repeats = 0
            with delayed():
                self._trial = trial = self._open_trial()
                values = self._suggested(trial)
                if values in known:
                    # Told once more, it would count twice.
                    self._study.tell(trial, state=TrialState.FAIL)
                    repeats += 1
                    continue
            error = self._family.error(values)
            if error is None:
                return values
            self._refuse(trial, str(error))
            known.add(values)
            repeats += 1
        return None

    def worse(self, batch: int, value: float) -> bool:
        """Whether the design under trial is worse than the best, by their values in the batches 0 to ``batch``.

        Batches are the same environments for all.
        """
        assert self._trial is not None
        with delayed():
            self._trial.report(value, batch)
            return bool(self._trial.should_prune())

    def refuse(self, reason: str, runs: int) -> None:
        """The design under trial has no worth, as its runs say, for a reason that holds whenever it is tried."""
        assert self._trial is not None
        self._refuse(self._trial, reason, runs)

    def refused_runs(self) -> int:
        """The runs of all designs that have no worth."""
        pruned = self._study.get_trials(deepcopy=False, states=(TrialState.PRUNED,))
        return sum(trial.user_attrs["runs"] for trial in pruned if "runs" in trial.user_attrs)

    def _refuse(self, trial: Trial, reason: str, runs: int = 0) -> None:
        with delayed():
            trial.set_user_attr("unbuildable", reason)
            trial.set_user_attr("runs", runs)
            trial.set_constraint(BUILDABLE, 1.0)
            self._study.tell(trial, state=TrialState.PRUNED)

    def tell(self, objectives: Sequence[float], environments: int, pruned: bool, mean_time_s: float) -> Tried:
        """What the design under trial is worth."""
        assert self._trial is not None
        with delayed():
            self._trial.set_constraint(BUILDABLE, 0.0)
            facts = {"environments": environments, "pruned": pruned, "mean_time_s": mean_time_s}
            self._trial.set_user_attr("facts", facts)
            return _tried(self._suggested(self._trial), self._study.tell(self._trial, list(objectives)))

    def best(self, tried: Sequence[Tried], count: int) -> list[Tried]:
        """The best ``count`` of those tried in all environments; with several objectives, those none beats in all."""
        whole = [one for one in tried if not one.pruned]
        signs = [-1 if one.largest else 1 for one in self._objectives]

        def losses(one: Tried) -> list[float]:
            return [sign * value for sign, value in zip(signs, one.objectives, strict=True)]

        def beaten(one: Tried) -> bool:
            mine = losses(one)
            others = (losses(other) for other in whole)
            return any(other != mine and all(a <= b for a, b in zip(other, mine, strict=True)) for other in others)

        front = whole if len(signs) == 1 else [one for one in whole if not beaten(one)]
        return sorted(front, key=lambda one: (losses(one), one.mean_time_s))[:count]

    def _open_trial(self) -> Trial:
        """The trial that was cut short, or else a new one."""
        trials = self._study.get_trials(deepcopy=False)
        self._study.sampler = self._sampler(len(trials))
        left = [trial for trial in trials if trial.state == TrialState.RUNNING]
        if left:
            return Trial(self._study, left[0]._trial_id)
        if len(trials) < len(self._grid):
            self._study.enqueue_trial(dict(zip(self._varied, self._grid[len(trials)], strict=True)))
        return self._study.ask()

    def _grid_is_tried(self) -> bool:
        trials = self._study.get_trials(deepcopy=False)
        return 0 < len(self._grid) <= len(trials) and all(trial.state.is_finished() for trial in trials)

    def _sampler(self, number: int) -> Any:
        seed = (self._seed * 1_000_003 + number) % 2**32
        if self._sampler_name == "tpe":
            return optuna.samplers.TPESampler(seed=seed, multivariate=True)
        if self._sampler_name == "nsga2":
            return optuna.samplers.NSGAIISampler(seed=seed, population_size=POPULATION)
        return optuna.samplers.RandomSampler(seed=seed)

    def _suggested(self, trial: Trial) -> Values:
        places = {key: trial.suggest_int(key, 0, len(self._levels[key]) - 1) for key in self._varied}
        return tuple(levels[places.get(key, 0)] for key, levels in self._levels.items())

    def _values(self, trial: FrozenTrial) -> Values:
        return tuple(levels[trial.params.get(key, 0)] for key, levels in self._levels.items())

    def _queue_unknown(self, known: set[Values]) -> bool:
        """Let a design that is not known be the next proposal; False if none is found."""
        draw = random.Random(f"{self._seed}/{len(known)}")
        for _ in range(DRAWS):
            places = {key: draw.randrange(len(self._levels[key])) for key in self._varied}
            values = tuple(levels[places.get(key, 0)] for key, levels in self._levels.items())
            if values not in known and self._family.error(values) is None:
                with delayed():
                    self._study.enqueue_trial(places)
                return True
        return False


class _PairedPruner(optuna.pruners.BasePruner):
    """Wilcoxon's signed-rank test of a trial's values against the best trial's at the same steps.

    Optuna's WilcoxonPruner takes 50 ms for equal values, as it permutes them; this one approximates (10 steps).
    """

    def prune(self, study: optuna.study.Study, trial: FrozenTrial) -> bool:
        """Whether the trial is worse than the best one that was not pruned itself, at a risk of PRUNING_RISK."""
        from scipy.stats import wilcoxon

        largest = study.direction == optuna.study.StudyDirection.MAXIMIZE
        told = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
        whole = [one for one in told if one.value is not None and not one.user_attrs["facts"]["pruned"]]
        if not whole or len(trial.intermediate_values) < LEAST_LOOKS:
            return False
        best = (max if largest else min)(whole, key=lambda one: one.value or 0.0).intermediate_values
        gains = [value - best[step] for step, value in trial.intermediate_values.items() if step in best]
        if not any(gains) or not all(map(math.isfinite, gains)):
            return False
        test = wilcoxon(gains, alternative="less" if largest else "greater", zero_method="zsplit", method="asymptotic")
        return bool(test.pvalue < PRUNING_RISK)


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
        [(2 * i + 1) * level // (2 * count) for i in range(count)]
        for level, count in zip(levels, counts, strict=True)
    ]
    return list(itertools.product(*places))


def _tried(values: Values, trial: FrozenTrial) -> Tried:
    return Tried(values, tuple(trial.values), **trial.user_attrs["facts"])
