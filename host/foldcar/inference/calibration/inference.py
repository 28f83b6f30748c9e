"""Calibrates the simulator by trials: simulates runs, fits the emulator, draws the posterior, checks and corrects it.

Input: observed trials, a simulator of their experiment. Output: an Inference. The same input, number of runs and seed
give the same numbers on any number of processes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from foldcar.belief.priors import PARAMETERS, FloatArray, ScorePrior, values_of
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
    """What a posterior is drawn from: trials, emulator, and priors.

    ``inputs`` are the emulator's, as in :func:`cell_inputs`: a row for each cell of the trials, then for each design.
    ``priors`` are the priors of scores that are not standard normal, by the parameter's index.
    """

    observed: Observations
    emulator: Emulator
    inputs: FloatArray
    priors: Mapping[int, ScorePrior]

    @cached_property
    def correlation(self) -> FloatArray:
        """Correlations (designs, cars): of the discrepancy of a new car of each design with that of each driven car."""
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

        The sampler works with latent values, whose prior is standard normal; ``with_priors`` converts them to scores.
        """

        def likelihood(latent: FloatArray, tau: FloatArray) -> FloatArray:
            return self._outcomes(self.with_priors(latent), tau).evidence

        latent_posterior = sample_posterior(likelihood, len(PARAMETERS), seed)
        return replace(latent_posterior, scores=self.with_priors(latent_posterior.scores))

    def logits(self, scores: FloatArray, designs: IntArray) -> FloatArray:
        """Return simulated success logits (n, designs) in any scene for scores (n, parameters)."""
        return self.emulator.logits(scores, self.inputs[len(self.observed.cells) + designs])

    def offsets(self, scores: FloatArray, tau: FloatArray, designs: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance (n, designs) of the discrepancy, in log-odds, of a new car of each design.

        ``scores`` (n, parameters) and ``tau`` (n,), the discrepancy's standard deviation, are draws of the posterior.
        """
        driven_cars = self._outcomes(scores, tau)
        new_cars = [
            driven_cars.new_car(tau[:, None] ** 2 * self.correlation[design], tau**2) for design in designs.tolist()
        ]
        means, variances = zip(*new_cars, strict=True)
        return np.column_stack(means), np.column_stack(variances)

    def _outcomes(self, scores: FloatArray, tau: FloatArray) -> Outcomes:
        """Infer the driven cars' log-odds offsets for scores (n, parameters) and standard deviations τ (n,).

        Cars of similar designs share a part of the discrepancy; each car also has its own variance, ``car_sd`` squared.
        """
        # The first rows of the inputs are those of the cells.
        logits = self.emulator.logits(scores, self.inputs[: len(self.observed.cells)])
        correlation = self.correlation[self.observed.car_design]
        covariance = tau[:, None, None] ** 2 * correlation + self.emulator.car_sd**2 * np.eye(len(correlation))
        cell, car, passed, counted = self._groups
        return outcomes(self.emulator.centre_factor * logits[:, cell], passed, counted, car, covariance)

    @cached_property
    def _groups(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Trials grouped by car and cell: four arrays (groups,) of cell, car, trials passed, trials in all."""
        cars = len(self.observed.car_design)
        # One number for each pair of cell and car, from which both are recovered.
        groups, group_of_trial = np.unique(self.observed.cell * cars + self.observed.car, return_inverse=True)
        passed = np.bincount(group_of_trial, self.observed.passed)
        return groups // cars, groups % cars, np.asarray(passed), np.bincount(group_of_trial).astype(np.float64)


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
    """How many simulations each stage of a calibration takes, ``runs`` in all.

    ``first`` sets of parameters come from the prior, ``second`` from around the first posterior. Then the rates of
    ``checked`` designs are simulated, with each published draw in ``scenes`` scenes.
    """

    first: int
    second: int
    checked: int
    scenes: int
    runs: int


def plan(runs: int, observed: Observations, designs: int) -> Plan:
    """Divide about ``runs`` simulations, at least MIN_RUNS, among the stages; ``designs`` is the size of the family."""
    runs = max(MIN_RUNS, runs)
    check_runs_per_draw = (1 - FIRST - SECOND) * runs / DRAWS
    checked = max(len(np.unique(observed.car_design)), min(designs, MAX_CHECKED, int(check_runs_per_draw)))
    runs_per_set = min(len(observed.cells), MAX_CELLS) + OTHERS
    first, second = int(FIRST * runs / runs_per_set), int(SECOND * runs / runs_per_set)
    scenes = max(1, int(check_runs_per_draw / checked))
    total = runs_per_set * (first + second) + DRAWS * checked * scenes
    return Plan(first, second, checked, scenes, runs=total)


def infer(
    simulator: Simulator,
    observed: Observations,
    runs: int,
    done: Callable[[int], None] = lambda runs: None,
    priors: Mapping[int, ScorePrior] = MappingProxyType({}),
) -> Inference:
    """Infer the simulator's parameters from trials with about ``runs`` simulations. Raises FoldcarError.

    The emulator is fitted twice: to runs with parameters from the prior, then also to runs near the first posterior.
    Last, the rates of designs are simulated. ``done`` is called with numbers of finished runs, which add up to Plan.runs.
    ``priors`` are as in Problem.
    """
    seed, experiment = simulator.seed, simulator.experiment
    inputs, design_inputs = cell_inputs(experiment, observed.cells)
    planned = plan(runs, observed, len(experiment.designs))

    def fitted_problem(bank: Bank) -> Problem:
        return Problem(observed, bank.emulator(inputs, design_inputs, seed), inputs, dict(priors))

    bank = simulate_bank(simulator, prior_scores(planned.first, seed), observed, 0, done)
    first_posterior = fitted_problem(bank).posterior(seed)
    near_scores = scores_near(first_posterior.scores, planned.second, seed)
    problem = fitted_problem(bank.joined(simulate_bank(simulator, near_scores, observed, planned.first, done)))
    driven = np.unique(observed.car_design)
    # The checked designs are the driven ones, and others evenly spaced over the family.
    spaced = planned.checked - (len(driven) if planned.checked < len(experiment.designs) else 0)
    designs = np.union1d(np.linspace(0, len(experiment.designs) - 1, spaced).round().astype(int), driven)
    # Above the numbers of all earlier cars and drives, so that the check has cars of its own.
    first_number = (planned.first + planned.second) * (MAX_CELLS + OTHERS + len(observed.car_design))
    return simulated_rates(simulator, problem, problem.posterior(seed), designs, planned.scenes, first_number, done)


def simulated_rates(
    simulator: Simulator,
    problem: Problem,
    posterior: Posterior,
    designs: IntArray,
    scenes: int,
    first_number: int,
    done: Callable[[int], None],
) -> Inference:
    """Simulate the ``designs`` (indices) with DRAWS draws of the posterior, each in ``scenes`` scenes; return the result.

    Every scene of a draw has a car and a drive of its own, numbered from ``first_number``.
    """
    chosen = np.random.default_rng(simulator.seed).choice(len(posterior.scores), DRAWS, replace=False)
    all_scenes = simulator.experiment.scenes
    values_of_drives = [values for values in values_of(posterior.scores[chosen]) for _ in range(scenes)]
    runs = [
        CalibrationRun(int(design), values, all_scenes[i % len(all_scenes)], first_number + i, first_number + i)
        for i, values in enumerate(values_of_drives)
        for design in designs
    ]
    # (drives, designs): in ``runs``, the designs of a drive follow each other.
    table = simulator.passes(runs, done).reshape(-1, len(designs))
    return Inference(problem, posterior, chosen, designs, table)


def design_correlation(designs: FloatArray) -> FloatArray:
    """Return correlations (designs, designs) of the discrepancies of designs with parameters (designs, k).

    A discrepancy is the sum of a part of all designs, a part of similar designs, and a part of each design.
    """
    scaled = unit_range(designs)
    shared: FloatArray = COMMON + SIMILAR * Matern(scaled, LENGTH).covariance(scaled, scaled)
    return shared + (1 - COMMON - SIMILAR) * np.eye(len(designs))
