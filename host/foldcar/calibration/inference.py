"""A calibration from trials: simulated runs, their emulator, the posterior, simulations that check and correct it.

Input: trials observed, a simulator of their experiment. Output: an Inference. The same input, number of runs and seed
give the same numbers, on any number of processes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.special import logsumexp

from foldcar.analysis.gaussian_process import Matern, unit_range
from foldcar.calibration.emulator import (
    LARGEST_LOGIT,
    MOST_CELLS,
    OTHERS,
    Bank,
    Emulator,
    cell_inputs,
    near_scores,
    prior_scores,
    simulate_bank,
    success_logits,
)
from foldcar.calibration.experiment import CalibrationRun, Simulator
from foldcar.calibration.observations import BoolArray, Observations
from foldcar.calibration.parameters import PARAMETERS, FloatArray, ScorePrior, values_of
from foldcar.calibration.posterior import Features, IntArray, Outcomes, Posterior, outcomes, sample_posterior

# Shares of the runs: from the prior, around posteriors in each of at most ROUNDS; the rest checks the result.
FIRST, ROUND, ROUNDS = 0.4, 0.15, 3
# Rounds end when the emulator errs less in the rate of each design.
TOLERATED = 0.03
# Runs at the posterior's edges teach; those farther from its middle than this (Mahalanobis) do not.
REACH = 6.0
# The published draws; fewer runs than LEAST_RUNS teach nothing.
DRAWS = 100
LEAST_RUNS = 500  # as `foldcar calibrate` says
# Designs of the family whose rates are checked.
MOST_CHECKED = 40
# Of a discrepancy, these parts are shared by all designs and by like ones, over this part of the family's range.
COMMON, ALIKE, LENGTH = 0.35, 0.35, 0.4
# Of that of paths, this part is each trial's own.
ALONE = 0.3
# Any number of trials tells by their paths and ways to fail as much as so many would if the simulator were right but for
# the discrepancies (a coarsened posterior: Miller and Dunson 2019, doi:10.1080/01621459.2018.1469995).
MOST_TRIALS = 12.0


@dataclass(frozen=True)
class Problem:
    """Trials, the emulator that explains them and the cells' ``inputs``.

    ``priors`` are those of parameters, by their index, whose scores are not standard normal before the trials.
    """

    observed: Observations
    emulator: Emulator
    inputs: FloatArray
    priors: Mapping[int, ScorePrior]

    @cached_property
    def other(self) -> FloatArray:
        """How far further cars of each design share a discrepancy (designs, cars) with the cars that drove."""
        designs = self.inputs[len(self.observed.cells) :, : self.emulator.designs]
        return likeness(designs)[:, self.observed.car_design]

    @cached_property
    def alike(self) -> FloatArray:
        """How far the cars that drove share a discrepancy (cars, cars)."""
        return self.other[self.observed.car_design]

    @property
    def free(self) -> list[int]:
        """The indices of the parameters that were not measured."""
        return [i for i in range(len(PARAMETERS)) if i not in self.priors or self.priors[i].sd > 0]

    def with_priors(self, latent: FloatArray) -> FloatArray:
        """The scores (n, parameters) of latent values that are standard normal before the trials."""
        scores: FloatArray = latent.copy()
        for index, prior in self.priors.items():
            scores[:, index] = prior.mean + prior.sd * latent[:, index]
        return scores

    def posterior(self, seed: int) -> Posterior:
        """Draws of the posterior."""
        features = self.features
        cells = self.inputs[: len(self.observed.cells)]

        def likelihood(latent: FloatArray, tau: FloatArray, kappa: FloatArray) -> FloatArray:
            scores = self.with_priors(latent)
            by_cell = self.emulator.end_chances(scores, cells)
            chances = by_cell[:, self.observed.cell]
            paths = self._ways(chances)
            if features is not None:
                paths = paths + features.log_likelihood(self._means(scores), kappa)
            weight = MOST_TRIALS / (MOST_TRIALS + len(self.observed.cell))
            return self._outcomes(success_logits(by_cell), tau).evidence + weight * paths

        found = sample_posterior(likelihood, len(PARAMETERS), seed)
        return replace(found, scores=self.with_priors(found.scores))

    def _outcomes(self, logits: FloatArray, tau: FloatArray) -> Outcomes:
        """The outcomes by the cells' simulated logits (n, cells) with discrepancies τ (n,)."""
        own = self.emulator.car_sd**2
        covariance = tau[:, None, None] ** 2 * self.alike + own * np.eye(len(self.alike))
        cell, car, passed, counted = self._groups
        return outcomes(self.emulator.middle * logits[:, cell], passed, counted, car, covariance)

    @cached_property
    def _groups(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Cell, car, passed and all trials (groups,) of each car in each cell."""
        cars = len(self.observed.car_design)
        found, of = np.unique(self.observed.cell * cars + self.observed.car, return_inverse=True)
        passed = np.bincount(of, self.observed.passed)
        return found // cars, found % cars, np.asarray(passed), np.bincount(of).astype(np.float64)

    def outcomes(self, scores: FloatArray, tau: FloatArray) -> Outcomes:
        """The outcomes of the trials under scores (n, parameters) with discrepancies τ (n,)."""
        return self._outcomes(self.emulator.logits(scores, self.inputs[: len(self.observed.cells)]), tau)

    def further(self, found: Outcomes, tau: FloatArray, design: int) -> tuple[FloatArray, FloatArray]:
        """Mean and variance (n,) of the discrepancy that further cars of a design have, by the outcomes of all trials."""
        return found.further(tau[:, None] ** 2 * self.other[design], tau**2)

    @cached_property
    def features(self) -> Features | None:
        """The trials' features; None if none is known that the emulator knows, too."""
        usable = np.isfinite(self.emulator.shares)
        observed = np.where(usable, np.clip(self.observed.features, *self.emulator.bounds), np.nan)
        if not np.isfinite(observed).any():
            return None
        car = self.observed.car
        same = (car[:, None] == car).astype(float)
        errors = np.where(np.isfinite(observed), self.observed.errors, 0.0)
        alike = (1 - ALONE) * self.alike[np.ix_(car, car)] + ALONE * np.eye(len(car))
        return Features(observed, errors, self.emulator.covariance, self.emulator.shares, same, alike)

    def residuals(self, scores: FloatArray) -> FloatArray | None:
        """What is left of the trials' features (n, trials, features), in standard deviations of runs; None without."""
        return None if self.features is None else self.features.residuals(self._means(scores))

    def _means(self, scores: FloatArray) -> FloatArray:
        cells = len(self.observed.cells)
        return self.emulator.feature_means(scores, self.inputs[:cells])[:, self.observed.cell]

    def _ways(self, chances: FloatArray) -> FloatArray:
        """The log probability (n,) of how the trials that did not pass failed, by chances (n, trials, ENDS)."""
        failed = self.observed.passed == 0
        ends = chances[:, failed, 1:]
        told = np.where(self.observed.ends[failed, 1:], ends, -np.inf)
        # No simulation tells that a way to fail is impossible.
        return np.asarray(np.maximum(logsumexp(told, axis=-1) - logsumexp(ends, axis=-1), -LARGEST_LOGIT).sum(axis=1))


@dataclass(frozen=True)
class Inference:
    """Everything a summary is made of; ``rounds`` were needed, ``error`` is by how much the emulator erred in the last.

    ``chosen`` are the indices of the published draws; ``designs`` (checked,) are those of the family whose rates were
    simulated with them: ``passed`` of ``counted`` (checked,).
    """

    problem: Problem
    posterior: Posterior
    chosen: IntArray
    designs: IntArray
    passed: FloatArray
    counted: FloatArray
    error: float
    rounds: int

    @property
    def draws(self) -> list[dict[str, float]]:
        """The published draws by name."""
        return values_of(self.posterior.scores[self.chosen])


@dataclass(frozen=True, slots=True)
class Plan:
    """How many sets of parameters are drawn from the prior and around posteriors; designs and scenes of the check."""

    first: int
    second: int
    checked: int
    scenes: int
    runs: int


def plan(runs: int, observed: Observations, designs: int) -> Plan:
    """About ``runs`` simulated runs for these trials and ``designs`` of the family; at least LEAST_RUNS."""
    runs = max(LEAST_RUNS, runs)
    last = (1 - FIRST - ROUNDS * ROUND) * runs / DRAWS
    driven = len(np.unique(observed.car_design))
    checked = max(driven, min(designs, MOST_CHECKED, int(last)))
    each = min(len(observed.cells), MOST_CELLS) + OTHERS
    first, second = int(FIRST * runs / each), int(ROUND * runs / each)
    scenes = max(1, int(last / checked))
    return Plan(first, second, checked, scenes, each * (first + ROUNDS * second) + DRAWS * checked * scenes)


def infer(
    simulator: Simulator,
    observed: Observations,
    runs: int,
    done: Callable[[int], None] = lambda runs: None,
    priors: Mapping[int, ScorePrior] = MappingProxyType({}),
) -> Inference:
    """Infer the parameters; ``priors`` as in Problem. ``done`` is called with finished runs, Plan.runs in all.

    FoldcarError.
    """
    seed, experiment = simulator.seed, simulator.experiment
    inputs, width = cell_inputs(experiment, observed.cells)
    planned = plan(runs, observed, len(experiment.designs))
    bank = simulate_bank(simulator, prior_scores(planned.first, seed), observed, 0, done)
    cars = observed.car_design

    def problem_of(bank: Bank) -> Problem:
        return Problem(observed, bank.emulator(inputs, width, seed), inputs, dict(priors))

    problem = problem_of(bank)
    posterior = problem.posterior(seed)
    error, rounds = np.inf, 0
    while rounds < ROUNDS:
        close = near_scores(posterior.scores, planned.second, seed + rounds)
        more = simulate_bank(simulator, close, observed, planned.first + rounds * planned.second, done)
        error, rounds = rate_error(problem, more), rounds + 1
        bank = bank.joined(more)
        problem = problem_of(bank.chosen(near(bank.scores, posterior.scores)))
        posterior = problem.posterior(seed)
        if error < TOLERATED:
            break
    unused = (ROUNDS - rounds) * planned.second * (min(len(observed.cells), MOST_CELLS) + OTHERS)
    spaced = planned.checked
    if spaced < len(experiment.designs):
        spaced -= len(np.unique(cars))
    designs = np.union1d(np.linspace(0, len(experiment.designs) - 1, spaced).round().astype(int), cars)
    scenes = planned.scenes + unused // (DRAWS * len(designs))
    first = (planned.first + ROUNDS * planned.second) * (MOST_CELLS + OTHERS + len(cars))
    return checked(simulator, problem, posterior, designs, scenes, first, done, float(error), rounds)


def checked(
    simulator: Simulator,
    problem: Problem,
    posterior: Posterior,
    designs: IntArray,
    scenes: int,
    first: int,
    done: Callable[[int], None],
    error: float = np.inf,
    rounds: int = 0,
) -> Inference:
    """The inference with the rates of ``designs``: DRAWS draws in ``scenes`` each, numbered from ``first``."""
    chosen = np.random.default_rng(simulator.seed).choice(len(posterior.scores), DRAWS, replace=False)
    every = simulator.experiment.scenes
    check = [
        # Each of the published draws with cars and in scenes of its own.
        CalibrationRun(int(design), values, every[number % len(every)], first + number, first + number)
        for number, values in enumerate(one for one in values_of(posterior.scores[chosen]) for _ in range(scenes))
        for design in designs
    ]
    drives = simulator.drives(check, done)
    table = np.array([np.nan if one is None else float(one.passed) for one in drives]).reshape(-1, len(designs))
    counted = np.isfinite(table).sum(axis=0).astype(float)
    return Inference(problem, posterior, chosen, designs, np.nansum(table, axis=0), counted, error, rounds)


def likeness(designs: FloatArray) -> FloatArray:
    """How far designs (designs, k) share a discrepancy (designs, designs): 1 with themselves."""
    scaled = unit_range(designs)
    found: FloatArray = COMMON + ALIKE * Matern(scaled, LENGTH).covariance(scaled, scaled)
    return found + (1 - COMMON - ALIKE) * np.eye(len(designs))


def rate_error(problem: Problem, bank: Bank) -> float:
    """By how much the emulator errs in the rate of a design with trials, at most, beyond chance; over the bank's runs."""
    cells, found = problem.observed.cells, []
    left = (bank.ends == 0) - bank.pass_chances(problem.emulator, problem.inputs)
    for design in np.unique(problem.observed.car_design):
        rest = left[[cell < len(cells) and cells[cell].design == design for cell in bank.cells]]
        found.append(max(0.0, abs(rest.mean()) - rest.std() / np.sqrt(len(rest))))
    return float(max(found))


def near(scores: FloatArray, draws: FloatArray) -> BoolArray:
    """Which scores (n, parameters) lie in reach of a posterior's draws, but for columns in which all draws are equal.

    The standard deviation of equal numbers is not always 0: their mean is rounded.
    """
    free = np.ptp(draws, axis=0) > 0
    if not free.any():
        return np.ones(len(scores), dtype=bool)
    centred = scores[:, free] - draws[:, free].mean(axis=0)
    precision = np.linalg.inv(np.atleast_2d(np.cov(draws[:, free].T)))
    return np.asarray(np.einsum("np,pq,nq->n", centred, precision, centred) < REACH**2)
