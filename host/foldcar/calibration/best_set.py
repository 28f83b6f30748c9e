"""The one set of parameters that explains the numbers of passed trials best, searched by simulation alone.

Sets are simulated in the same scenes and with the same cars: first the posterior's draws that the emulator likes best,
then, in each round, those that a smooth model of each design's rate over all sets so far likes best, among many around
each of the best known ones, closer each time. These lie apart: unlike sets may explain the trials alike. Of the last ones
further runs choose one, and others tell its rates. There is no discrepancy: each trial of a design passes with the
simulated rate.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, xlog1py, xlogy
from scipy.stats import binom

from foldcar.analysis.gaussian_process import SuccessModel, success_model
from foldcar.calibration.experiment import CalibrationRun, Simulator
from foldcar.calibration.inference import Inference
from foldcar.calibration.parameters import LARGEST_SCORE, FloatArray, values_of

FIRST, SCENES = 60, 40
# The spread of new sets about the best ones, by round, in standard deviations of the prior.
SPREADS = (0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1)
# Of each round: best sets, at least so far apart, about each of which some are drawn and the likeliest are simulated.
PARENTS, APART, DRAWN, NEW = 6, 2.0, 1000, 4
LAST, LAST_SCENES = 3, 300
# Numbers of runs, beyond those of any calibration.
FIRST_NUMBER = 10**9


@dataclass(frozen=True)
class BestSet:
    """``values`` by name; ``rates`` (designs with trials,), each of ``scenes`` runs that did not choose the set.

    ``log_likelihood`` is that of the trials, with a 90 % ``interval`` for the chance of these runs.
    """

    values: Mapping[str, float]
    rates: FloatArray
    log_likelihood: float
    interval: tuple[float, float]
    scenes: int


def best_set_runs(designs: int) -> int:
    """How many runs a search takes for so many designs with trials."""
    return designs * ((FIRST + len(SPREADS) * PARENTS * NEW) * SCENES + (LAST + 1) * LAST_SCENES)


def best_set(simulator: Simulator, inference: Inference, done: Callable[[int], None] = lambda runs: None) -> BestSet:
    """The best set for the trials of an inference, within the priors' range. FoldcarError."""
    counts = inference.problem.observed.counts()
    designs = np.array(list(counts))
    passed, counted = np.array(list(counts.values()), dtype=float).T
    stream = np.random.default_rng(simulator.seed)

    def simulated(scores: FloatArray, first: int, scenes: int) -> FloatArray:
        """How many of ``scenes`` runs (sets, designs) pass."""
        every = simulator.experiment.scenes
        runs = [
            CalibrationRun(int(design), values, every[number % len(every)], FIRST_NUMBER + number, FIRST_NUMBER + number)
            for values in values_of(scores)
            for design in designs
            for number in range(first, first + scenes)
        ]
        drives = simulator.drives(runs, done)
        table = np.array([one is not None and one.passed for one in drives], dtype=float)
        return np.asarray(table.reshape(len(scores), len(designs), scenes).sum(axis=2))

    def told(rates: FloatArray) -> FloatArray:
        return np.asarray((xlogy(passed, rates) + xlog1py(counted - passed, -rates)).sum(axis=1))

    draws, cells = inference.posterior.scores, len(inference.problem.observed.cells)
    logits = inference.problem.emulator.logits(draws, inference.problem.inputs[cells + designs])
    sets = draws[np.argsort(-told(expit(logits)))[:FIRST]].clip(-LARGEST_SCORE, LARGEST_SCORE)
    free = [one for one in range(draws.shape[1]) if one not in inference.problem.known]
    # The edges belong to the range of the model, which has no rates beyond that of the sets.
    edges = np.tile(sets[0], (2, 1))
    edges[:, free] = [[-LARGEST_SCORE], [LARGEST_SCORE]]
    sets = np.vstack([sets[:-2], edges])
    good = simulated(sets, 0, SCENES)

    def liked(model: list[SuccessModel], some: FloatArray, most: int) -> FloatArray:
        """At most so many of the sets, the best first."""
        rates = np.column_stack([of_design.rates(some[:, free])[0] for of_design in model])
        return some[np.argsort(-told(rates))[:most]]

    def smooth() -> list[SuccessModel]:
        runs = np.full(len(sets), float(SCENES))
        return [success_model(sets[:, free], column, runs) for column in good.T]

    def around(parent: FloatArray, spread: float) -> FloatArray:
        drawn = np.tile(parent, (DRAWN, 1))
        drawn[:, free] += spread * stream.standard_normal((DRAWN, len(free)))
        return drawn.clip(-LARGEST_SCORE, LARGEST_SCORE)

    for spread in SPREADS:
        model = smooth()
        fresh = np.vstack([
            liked(model, around(parent, spread), NEW) for parent in _apart(liked(model, sets, len(sets)))
        ])  # fmt: skip
        sets, good = np.vstack([sets, fresh]), np.vstack([good, simulated(fresh, 0, SCENES)])
    sets = liked(smooth(), sets, LAST)
    judged = told((simulated(sets, SCENES, LAST_SCENES) + 0.5) / (LAST_SCENES + 1))
    chosen = sets[[int(np.argmax(judged))]]
    last = simulated(chosen, SCENES + LAST_SCENES, LAST_SCENES)[0]
    rates = (last + 0.5) / (LAST_SCENES + 1)
    # By Jeffreys' posterior of each rate.
    drawn = stream.beta(last + 0.5, LAST_SCENES - last + 0.5, (4000, len(designs)))
    low, high = np.quantile(binom.logpmf(passed, counted, drawn).sum(axis=1), [0.05, 0.95])
    values = values_of(chosen)[0]
    return BestSet(
        values, rates, float(binom.logpmf(passed, counted, rates).sum()), (float(low), float(high)), LAST_SCENES
    )


def _apart(sets: FloatArray) -> FloatArray:
    """The first PARENTS of the sets that are at least APART; if there are fewer, the first ones again."""
    chosen = sets[:1]
    for one in sets[1:]:
        if len(chosen) < PARENTS and np.linalg.norm(chosen - one, axis=1).min() >= APART:
            chosen = np.vstack([chosen, one])
    return np.resize(chosen, (PARENTS, sets.shape[1]))
