"""The one set of parameters that explains the numbers of passed trials best, searched by simulation alone.

A population begins with the posterior's draws that the emulator likes best. In each round all are simulated in the same
scenes and with the same cars; the best are kept, with the runs that they have, and others are drawn around them, closer
each time. The last ones are simulated in scenes that did not choose them. There is no discrepancy: each trial of a design
passes with the simulated rate.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import xlog1py, xlogy
from scipy.stats import binom

from foldcar.calibration.experiment import CalibrationRun, Simulator
from foldcar.calibration.inference import Inference
from foldcar.calibration.parameters import LARGEST_SCORE, FloatArray, values_of

POPULATION, KEPT, SCENES = 24, 6, 25
# The spread of new sets about the kept ones, by round, in standard deviations of the prior.
SPREADS = (0.5, 0.4, 0.3, 0.2, 0.15)
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
    return designs * (len(SPREADS) * POPULATION * SCENES + LAST * LAST_SCENES)


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

    def score(good: FloatArray, all_runs: FloatArray) -> FloatArray:
        rates = (good + 0.5) / (all_runs[:, None] + 1)
        return np.asarray((xlogy(passed, rates) + xlog1py(counted - passed, -rates)).sum(axis=1))

    draws = inference.posterior.scores
    cells = len(inference.problem.observed.cells)
    logits = inference.problem.emulator.logits(draws, inference.problem.inputs[cells + designs])
    rates = 1 / (1 + np.exp(-logits))
    liked = np.argsort(-(xlogy(passed, rates) + xlog1py(counted - passed, -rates)).sum(axis=1))
    sets = draws[liked[:POPULATION]]
    good, number = np.zeros((0, len(designs))), np.zeros(0)
    for turn, spread in enumerate(SPREADS):
        fresh = sets[len(good) :]
        # Those that are kept meet further scenes, new ones as many from the first on.
        good = np.vstack([good + simulated(sets[: len(good)], turn * SCENES, SCENES), simulated(fresh, 0, SCENES)])
        number = np.append(number + SCENES, np.full(len(fresh), float(SCENES)))
        best = np.argsort(-score(good, number))[:KEPT]
        sets, good, number = sets[best], good[best], number[best]
        parents = sets[stream.integers(0, KEPT, POPULATION - KEPT)]
        near = parents + spread * stream.standard_normal(parents.shape)
        near[:, list(inference.problem.known)] = parents[:, list(inference.problem.known)]
        sets = np.vstack([sets, near.clip(-LARGEST_SCORE, LARGEST_SCORE)])
    last = simulated(sets[:LAST], len(SPREADS) * SCENES, LAST_SCENES)
    chosen = int(np.argmax(score(last, np.full(LAST, float(LAST_SCENES)))))
    rates = (last[chosen] + 0.5) / (LAST_SCENES + 1)
    # By Jeffreys' posterior of each rate.
    drawn = stream.beta(last[chosen] + 0.5, LAST_SCENES - last[chosen] + 0.5, (4000, len(designs)))
    low, high = np.quantile(binom.logpmf(passed, counted, drawn).sum(axis=1), [0.05, 0.95])
    values = values_of(sets[[chosen]])[0]
    return BestSet(
        values, rates, float(binom.logpmf(passed, counted, rates).sum()), (float(low), float(high)), LAST_SCENES
    )
