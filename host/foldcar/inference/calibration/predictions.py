"""Predicts success rates of designs and numbers of passed trials from a posterior.

Input: a problem and draws of its posterior. Output: draws of rates, log probabilities of counts, log scores (natural
logarithms).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit, logsumexp
from scipy.stats import binom

from foldcar.belief.priors import FloatArray
from foldcar.inference.calibration.experiment import SweptExperiment
from foldcar.inference.calibration.inference import Inference, Problem
from foldcar.inference.calibration.posterior import IntArray, Posterior
from foldcar.statistics.smoothed_simulation import smoothed_simulation

# Gauss-Hermite quadrature for the mean over a standard normal variable.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()


@dataclass(frozen=True)
class Rates:
    """Rates of the checked designs.

    ``simulated`` (checked,) are the rates of runs with the published draws, smoothed over designs. Draws (n, checked):
    ``calibrated`` are the simulator's rates under the posterior, ``predicted`` those of built cars. ``shifts`` (checked,)
    correct the emulator's log-odds to the simulated rates, ``variances`` (checked,) are the counting variances of the
    shifts. ``emulator_error`` is the largest error, beyond chance, in the rate of a design with trials.
    """

    simulated: FloatArray
    calibrated: FloatArray
    predicted: FloatArray
    shifts: FloatArray
    variances: FloatArray
    emulator_error: float

    def errors(self, designs: IntArray) -> dict[int, tuple[float, float]]:
        """Return the emulator's (shift, variance) by the design's index; ``designs`` are the checked ones."""
        return dict(zip(designs.tolist(), zip(self.shifts.tolist(), self.variances.tolist(), strict=True), strict=True))


def rates_of(inference: Inference, experiment: SweptExperiment, seed: int) -> Rates:
    """Predict the success rates of the checked designs.

    The emulator's log-odds are shifted so that their mean rates equal the simulated ones. Then the uncertainty of the
    simulated rates and the cars' offsets are added as random draws.
    """
    problem, posterior, designs = inference.problem, inference.posterior, inference.designs
    # inference.table is (drives, designs).
    passed_and_counted = np.column_stack([np.nansum(inference.table, axis=0), np.isfinite(inference.table).sum(axis=0)])
    varied = [list(experiment.varied(design).values()) for design in designs.tolist()]
    simulated = smoothed_simulation(np.array(varied), passed_and_counted, inference.table.T)
    # (designs,) and (n, designs)
    rates, logits = expit(simulated.mean), problem.logits(posterior.scores, designs)
    shifts = np.array([_shift(column, rate) for column, rate in zip(logits[inference.chosen].T, rates, strict=True)])
    mean, variance = problem.offsets(posterior.scores, posterior.discrepancy, designs)
    # The emulator's error beyond one standard deviation of the simulated rate; its slope by log-odds is rate (1 - rate).
    excess_error = abs(expit(logits).mean(axis=0) - rates) - np.sqrt(simulated.variance) * rates * (1 - rates)
    error = max(0.0, float(excess_error[np.isin(designs, problem.observed.car_design)].max()))
    stream = np.random.default_rng(seed)
    offsets = mean + np.sqrt(variance) * stream.standard_normal(mean.shape)
    errors = stream.standard_normal((len(mean), simulated.columns.shape[1])) @ simulated.columns.T
    logits = logits + shifts + errors + np.sqrt(simulated.rest) * stream.standard_normal(mean.shape)
    return Rates(
        rates,
        calibrated=expit(logits),
        predicted=expit(logits + offsets),
        shifts=shifts,
        variances=simulated.variance,
        emulator_error=error,
    )


def _shift(logits: FloatArray, rate: float) -> float:
    """Return the shift of logits (n,) that makes their mean rate equal ``rate``."""
    return float(brentq(lambda shift: expit(logits + shift).mean() - rate, -30, 30))


def trial_chances(
    problem: Problem, posterior: Posterior, counts: Mapping[int, int], errors: Mapping[int, tuple[float, float]]
) -> dict[int, FloatArray]:
    """Return log probabilities (n draws, trials + 1) that a new car passes in 0, 1, … or all trials, by design.

    ``counts`` are the numbers of trials, ``errors`` the emulator's (shift, variance) as in Rates. All are by the design's
    index.
    """
    designs = np.array(list(counts))
    means, variances = problem.offsets(posterior.scores, posterior.discrepancy, designs)
    logits, chances = problem.logits(posterior.scores, designs), {}
    for i, (design, counted) in enumerate(counts.items()):
        shift, variance = errors[design]
        chances[design] = count_chances(problem, logits[:, i] + shift, means[:, i], variances[:, i] + variance, counted)
    return chances


def count_chances(
    problem: Problem, logits: FloatArray, mean: FloatArray, variance: FloatArray, counted: int
) -> FloatArray:
    """Return log probabilities (n, counted + 1) of 0 … ``counted`` passes in ``counted`` trials of a new car.

    ``logits`` (n,) are simulated, ``mean`` and ``variance`` (n,) those of its discrepancy. Binomial probabilities are
    averaged over the car's normal offset by quadrature.
    """
    spread = np.sqrt(variance + problem.emulator.car_sd**2)
    rates = expit((problem.emulator.centre_factor * logits + mean)[:, None] + spread[:, None] * _NODES)
    # pmf is (n, counted + 1, nodes). The tiny addend keeps the logarithm finite.
    return np.asarray(np.log(binom.pmf(np.arange(counted + 1)[:, None], counted, rates[:, None]) @ _WEIGHTS + 1e-300))


def fraction_interval(chances: FloatArray, confidence: float) -> tuple[float, float]:
    """Return the central interval of the fraction that passes, for log probabilities (n, counted + 1) of counts."""
    cumulated = np.exp(chances).mean(axis=0).cumsum()
    low, high = np.searchsorted(cumulated, [(1 - confidence) / 2, (1 + confidence) / 2])
    return low / (len(cumulated) - 1), min(high, len(cumulated) - 1) / (len(cumulated) - 1)


def log_score(chances: FloatArray, passed: int) -> float:
    """Return the log of the mean probability that ``passed`` trials pass; ``chances`` (n, counted + 1) are logs."""
    return float(logsumexp(chances[:, passed]) - np.log(len(chances)))
