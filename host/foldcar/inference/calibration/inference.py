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

from foldcar.inference.calibration.emulator import (
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
from foldcar.inference.calibration.experiment import CalibrationRun, Simulator
from foldcar.inference.calibration.observations import Observations
from foldcar.inference.calibration.parameters import PARAMETERS, FloatArray, ScorePrior, values_of
from foldcar.inference.calibration.posterior import Features, IntArray, Outcomes, Posterior, outcomes, sample_posterior
from foldcar.statistics.gaussian_process import Matern, unit_range

# Fractions of the runs: from the prior, around the first posterior; the rest checks the result.
FIRST, SECOND = 0.4, 0.2
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
    def likeness(self) -> FloatArray:
        """How far further cars of each design share a discrepancy (designs, cars) with the cars that drove."""
        designs = self.inputs[len(self.observed.cells) :, : self.emulator.designs]
        return likeness(designs)[:, self.observed.car_design]

    @property
    def alike(self) -> FloatArray:
        """How far the cars that drove share a discrepancy (cars, cars)."""
        return self.likeness[self.observed.car_design]

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
        weight = MOST_TRIALS / (MOST_TRIALS + len(self.observed.cell))

        def likelihood(latent: FloatArray, tau: FloatArray, kappa: FloatArray) -> FloatArray:
            scores = self.with_priors(latent)
            chances = self.emulator.end_chances(scores, self._cells)
            paths = self._ways(chances[:, self.observed.cell])
            if self.features is not None:
                paths = paths + self.features.log_likelihood(self._means(scores), kappa)
            return self._outcomes(success_logits(chances), tau).evidence + weight * paths

        posterior = sample_posterior(likelihood, len(PARAMETERS), seed)
        return replace(posterior, scores=self.with_priors(posterior.scores))

    def logits(self, scores: FloatArray, designs: IntArray) -> FloatArray:
        """Simulated success logits (n, designs) in any scene under scores (n, parameters)."""
        return self.emulator.logits(scores, self.inputs[len(self.observed.cells) + designs])

    def offsets(self, scores: FloatArray, tau: FloatArray, designs: IntArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance (n, designs) of the discrepancy of a further car of each design, by the trials' outcomes.

        ``scores`` (n, parameters) and ``tau`` (n,) are draws of the posterior.
        """
        cars = self._outcomes(self.emulator.logits(scores, self._cells), tau)
        pairs = [cars.further(tau[:, None] ** 2 * self.likeness[design], tau**2) for design in designs.tolist()]
        means, variances = zip(*pairs, strict=True)
        return np.column_stack(means), np.column_stack(variances)

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
        groups, of = np.unique(self.observed.cell * cars + self.observed.car, return_inverse=True)
        passed = np.bincount(of, self.observed.passed)
        return groups // cars, groups % cars, np.asarray(passed), np.bincount(of).astype(np.float64)

    @property
    def _cells(self) -> FloatArray:
        return self.inputs[: len(self.observed.cells)]

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
        return self.emulator.feature_means(scores, self._cells)[:, self.observed.cell]

    def _ways(self, chances: FloatArray) -> FloatArray:
        """The log probability (n,) of how the trials that did not pass failed, by chances (n, trials, ENDS)."""
        failed = self.observed.passed == 0
        ends = chances[:, failed, 1:]
        seen = np.where(self.observed.ends[failed, 1:], ends, -np.inf)
        # No simulation tells that a way to fail is impossible.
        return np.asarray(np.maximum(logsumexp(seen, axis=-1) - logsumexp(ends, axis=-1), -LARGEST_LOGIT).sum(axis=1))


@dataclass(frozen=True)
class Inference:
    """Everything a summary is made of.

    ``chosen`` are the indices of the published draws; ``designs`` (checked,) are those of the family whose rates were
    simulated with them: ``table`` (drives, checked) is 1 where a drive passed, 0 where not, NaN where it failed. In a row
    all designs meet one scene under one draw.
    """

    problem: Problem
    posterior: Posterior
    chosen: IntArray
    designs: IntArray
    table: FloatArray

    @property
    def draws(self) -> list[dict[str, float]]:
        """The published draws by name."""
        return values_of(self.posterior.scores[self.chosen])


@dataclass(frozen=True, slots=True)
class Plan:
    """Numbers of sets of parameters from the prior and around the first posterior; of designs and scenes of the check."""

    first: int
    second: int
    checked: int
    scenes: int
    runs: int


def plan(runs: int, observed: Observations, designs: int) -> Plan:
    """About ``runs`` simulated runs for these trials and ``designs`` of the family; at least LEAST_RUNS."""
    runs = max(LEAST_RUNS, runs)
    last = (1 - FIRST - SECOND) * runs / DRAWS
    checked = max(len(np.unique(observed.car_design)), min(designs, MOST_CHECKED, int(last)))
    each = min(len(observed.cells), MOST_CELLS) + OTHERS
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
    """Infer the parameters; ``priors`` as in Problem. ``done`` is called with finished runs, Plan.runs in all.

    Raises FoldcarError.
    """
    seed, experiment = simulator.seed, simulator.experiment
    inputs, width = cell_inputs(experiment, observed.cells)
    planned = plan(runs, observed, len(experiment.designs))

    def problem_of(bank: Bank) -> Problem:
        return Problem(observed, bank.emulator(inputs, width, seed), inputs, dict(priors))

    bank = simulate_bank(simulator, prior_scores(planned.first, seed), observed, 0, done)
    problem = problem_of(bank)
    close = near_scores(problem.posterior(seed).scores, planned.second, seed)
    problem = problem_of(bank.joined(simulate_bank(simulator, close, observed, planned.first, done)))
    driven = np.unique(observed.car_design)
    spaced = planned.checked - (len(driven) if planned.checked < len(experiment.designs) else 0)
    designs = np.union1d(np.linspace(0, len(experiment.designs) - 1, spaced).round().astype(int), driven)
    first = (planned.first + planned.second) * (MOST_CELLS + OTHERS + len(observed.car_design))
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
    """The inference with the rates of ``designs``: DRAWS draws in ``scenes`` each, numbered from ``first``."""
    chosen = np.random.default_rng(simulator.seed).choice(len(posterior.scores), DRAWS, replace=False)
    every = simulator.experiment.scenes
    check = [
        # Each of the published draws with cars and in scenes of its own.
        CalibrationRun(int(design), values, every[number % len(every)], first + number, first + number)
        for number, values in enumerate(values for values in values_of(posterior.scores[chosen]) for _ in range(scenes))
        for design in designs
    ]
    drives = simulator.drives(check, done)
    table = np.array([np.nan if drive is None else float(drive.passed) for drive in drives])
    return Inference(problem, posterior, chosen, designs, table.reshape(-1, len(designs)))


def likeness(designs: FloatArray) -> FloatArray:
    """How far designs (designs, k) share a discrepancy (designs, designs): 1 with themselves."""
    scaled = unit_range(designs)
    shared: FloatArray = COMMON + ALIKE * Matern(scaled, LENGTH).covariance(scaled, scaled)
    return shared + (1 - COMMON - ALIKE) * np.eye(len(designs))
