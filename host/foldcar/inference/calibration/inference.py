"""Calibrates the simulator by trials: simulates runs, fits the emulator, draws the posterior, checks and corrects it.

Input: observed trials, a simulator of their experiment. Output: an Inference. The same input, number of runs and seed
give the same numbers on any number of processes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from foldcar.inference.calibration.emulator import (
    MAX_CELLS,
    OTHERS,
    Bank,
    Emulator,
    cell_inputs,
    prior_scores,
    scores_near,
    simulate_bank,
)
from foldcar.inference.calibration.experiment import CalibrationRun, Simulator
from foldcar.inference.calibration.observations import Observations
from foldcar.inference.calibration.parameters import PARAMETERS, FloatArray, ScorePrior, values_of
from foldcar.inference.calibration.posterior import IntArray, Outcomes, Posterior, outcomes, sample_posterior
from foldcar.statistics.gaussian_process import Matern, unit_range

# Fractions of the runs from the prior and around the first posterior; the remaining runs check the result.
FIRST, SECOND = 0.4, 0.2
# Number of published draws.
DRAWS = 100
MIN_RUNS = 500  # as `foldcar calibrate` says
# Designs of the family whose rates are checked.
MAX_CHECKED = 40
# Fractions of the discrepancy's variance that all designs share and that similar designs share; length of similarity as a
# fraction of the family's range.
COMMON, SIMILAR, LENGTH = 0.35, 0.35, 0.4


@dataclass(frozen=True)
class Problem:
    """Trials, the emulator that explains them, and the cells' ``inputs``.

    ``priors`` are those of parameters, by index, whose scores are not standard normal before the trials.
    """

    observed: Observations
    emulator: Emulator
    inputs: FloatArray
    priors: Mapping[int, ScorePrior]

    @cached_property
    def correlation(self) -> FloatArray:
        """Correlations (designs, cars) of a further car's discrepancy with those of the cars of the trials."""
        designs = self.inputs[len(self.observed.cells) :, : self.emulator.designs]
        return design_correlation(designs)[:, self.observed.car_design]

    @property
    def free(self) -> list[int]:
        """The indices of the parameters that were not measured."""
        return [i for i in range(len(PARAMETERS)) if i not in self.priors or self.priors[i].sd > 0]

    def with_priors(self, latent: FloatArray) -> FloatArray:
        """Return scores (n, parameters) for latent values that are standard normal before the trials."""
        scores: FloatArray = latent.copy()
        for index, prior in self.priors.items():
            scores[:, index] = prior.mean + prior.sd * latent[:, index]
        return scores

    def posterior(self, seed: int) -> Posterior:
        """Draw from the posterior of the scores.

        The sampler works with latent values, whose prior is standard normal; the result has them as scores.
        """

        def likelihood(latent: FloatArray, tau: FloatArray) -> FloatArray:
            return self._outcomes(self.with_priors(latent), tau).evidence

        latent_posterior = sample_posterior(likelihood, len(PARAMETERS), seed)
        return replace(latent_posterior, scores=self.with_priors(latent_posterior.scores))

    def logits(self, scores: FloatArray, designs: IntArray) -> FloatArray:
        """Return simulated success logits (n, designs) in any scene for scores (n, parameters)."""
        return self.emulator.logits(scores, self.inputs[len(self.observed.cells) + designs])

    def offsets(self, scores: FloatArray, tau: FloatArray, designs: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance (n, designs) of the discrepancy of a further car of each design.

        ``scores`` (n, parameters) and ``tau`` (n,) are draws of the posterior.
        """
        cars = self._outcomes(scores, tau)
        pairs = [cars.further(tau[:, None] ** 2 * self.correlation[design], tau**2) for design in designs.tolist()]
        means, variances = zip(*pairs, strict=True)
        return np.column_stack(means), np.column_stack(variances)

    def _outcomes(self, scores: FloatArray, tau: FloatArray) -> Outcomes:
        """Infer cars' offsets for scores (n, parameters) with discrepancies τ (n,)."""
        logits = self.emulator.logits(scores, self.inputs[: len(self.observed.cells)])
        shared = self.correlation[self.observed.car_design]
        covariance = tau[:, None, None] ** 2 * shared + self.emulator.car_sd**2 * np.eye(len(shared))
        cell, car, passed, counted = self._groups
        return outcomes(self.emulator.centre_factor * logits[:, cell], passed, counted, car, covariance)

    @cached_property
    def _groups(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Cell, car, number of passed and of all trials (groups,) for each car in each cell."""
        cars = len(self.observed.car_design)
        groups, of = np.unique(self.observed.cell * cars + self.observed.car, return_inverse=True)
        passed = np.bincount(of, self.observed.passed)
        return groups // cars, groups % cars, np.asarray(passed), np.bincount(of).astype(np.float64)


@dataclass(frozen=True)
class Inference:
    """The result of a calibration.

    ``chosen`` are the indices of the published draws, ``designs`` (checked,) those of the designs simulated with them.
    ``table`` (drives, checked) is 1 if the drive passed, 0 if not, NaN if the simulation failed; a row has one scene and
    one draw.
    """

    problem: Problem
    posterior: Posterior
    chosen: IntArray
    designs: IntArray
    table: FloatArray

    @property
    def draws(self) -> list[dict[str, float]]:
        """The published draws as values by name."""
        return values_of(self.posterior.scores[self.chosen])


@dataclass(frozen=True, slots=True)
class Plan:
    """Numbers of parameter sets from the prior and around the first posterior, of checked designs and their scenes."""

    first: int
    second: int
    checked: int
    scenes: int
    runs: int


def plan(runs: int, observed: Observations, designs: int) -> Plan:
    """Plan about ``runs`` simulated runs, at least MIN_RUNS, for these trials and a family of ``designs``."""
    runs = max(MIN_RUNS, runs)
    last = (1 - FIRST - SECOND) * runs / DRAWS
    checked = max(len(np.unique(observed.car_design)), min(designs, MAX_CHECKED, int(last)))
    each = min(len(observed.cells), MAX_CELLS) + OTHERS
    first, second = int(FIRST * runs / each), int(SECOND * runs / each)
    scenes = max(1, int(last / checked))
    return Plan(first, second, checked, scenes, each * (first + second) + DRAWS * checked * scenes)


def infer(
    simulator: Simulator,
    observed: Observations,
    runs: int,
    done: Callable[[int], None] = lambda runs: None,
    priors: Mapping[int, ScorePrior] = MappingProxyType({}),
) -> Inference:
    """Infer the parameters; ``priors`` are as in Problem. Raises FoldcarError.

    ``done`` is called with numbers of finished runs, which add up to Plan.runs.
    """
    seed, experiment = simulator.seed, simulator.experiment
    inputs, width = cell_inputs(experiment, observed.cells)
    planned = plan(runs, observed, len(experiment.designs))

    def problem_of(bank: Bank) -> Problem:
        return Problem(observed, bank.emulator(inputs, width, seed), inputs, dict(priors))

    bank = simulate_bank(simulator, prior_scores(planned.first, seed), observed, 0, done)
    problem = problem_of(bank)
    close = scores_near(problem.posterior(seed).scores, planned.second, seed)
    problem = problem_of(bank.joined(simulate_bank(simulator, close, observed, planned.first, done)))
    driven = np.unique(observed.car_design)
    spaced = planned.checked - (len(driven) if planned.checked < len(experiment.designs) else 0)
    designs = np.union1d(np.linspace(0, len(experiment.designs) - 1, spaced).round().astype(int), driven)
    first = (planned.first + planned.second) * (MAX_CELLS + OTHERS + len(observed.car_design))
    return checked(simulator, problem, problem.posterior(seed), designs, planned.scenes, first, done)


def checked(
    simulator: Simulator,
    problem: Problem,
    posterior: Posterior,
    designs: IntArray,
    scenes: int,
    first: int,
    done: Callable[[int], None],
) -> Inference:
    """Simulate the rates of ``designs`` with DRAWS draws in ``scenes`` scenes each, numbered from ``first``."""
    chosen = np.random.default_rng(simulator.seed).choice(len(posterior.scores), DRAWS, replace=False)
    every = simulator.experiment.scenes
    check = [
        # Each of the published draws with cars and in scenes of its own.
        CalibrationRun(int(design), values, every[number % len(every)], first + number, first + number)
        for number, values in enumerate(values for values in values_of(posterior.scores[chosen]) for _ in range(scenes))
        for design in designs
    ]
    table = simulator.passes(check, done).reshape(-1, len(designs))
    return Inference(problem, posterior, chosen, designs, table)


def design_correlation(designs: FloatArray) -> FloatArray:
    """Return correlations (designs, designs) of the discrepancies of designs (designs, k)."""
    scaled = unit_range(designs)
    shared: FloatArray = COMMON + SIMILAR * Matern(scaled, LENGTH).covariance(scaled, scaled)
    return shared + (1 - COMMON - SIMILAR) * np.eye(len(designs))
