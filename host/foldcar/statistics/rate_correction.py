"""Estimate success rates in a slow simulation from many runs in a fast one and few runs in both."""

from itertools import product
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError
from foldcar.statistics.gaussian_process import LENGTHS, MANY_LENGTHS, Matern, evidence_weights, unit_range
from foldcar.statistics.rate import check_confidence
from foldcar.statistics.smoothed_simulation import smoothed_simulation

# Standard deviations of the difference of rates: of its mean over designs, candidates of its smooth part, candidates of
# the part of each design alone.
MEAN_DIFFERENCE, SMOOTH_DIFFERENCES, OWN_DIFFERENCES = 0.15, (0.1, 0.2), (0.05, 0.1)
# Each design's variance is averaged with the mean variance over designs, which counts as this many runs.
POOLED_RUNS = 10
MIN_VARIANCE = 1e-3


def corrected_rates(
    parameters: ArrayLike, passed_fast: ArrayLike, passed_slow: ArrayLike, confidence: float = 0.95
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return success rates in the slow simulation with their credible bands (rate, low, high), each (designs,), 0 to 1.

    ``passed_fast`` and ``passed_slow`` (designs, environments) are 1 where a run passed, 0 where it did not, NaN where
    the simulation has no run; a column is the same environment in both. ``parameters`` (designs, k) are those of the
    designs. The result of a design without a run in the fast simulation is NaN. Raises FoldcarError if fewer than two
    environments have runs in both simulations.

    The rate is the rate in the fast simulation, smoothed over designs, plus the estimated difference of both rates. Let d
    be the designs' mean differences over the environments with runs in both simulations. It is normal with covariance
    K + S, so the estimated difference is K (K + S)^-1 d. K is the covariance of the true differences: the sum of a
    constant, a Matérn process over designs, and an independent part of each design. Candidates for K are weighted by
    their evidence. S is the sampling noise: an independent part of each design, and a part that all designs share because
    they have the same environments.

    Example: ``rate, low, high = corrected_rates(widths[:, None], multibody, mujoco)``
    """
    from scipy.special import ndtri

    check_confidence(confidence)
    all_parameters = numpy.asarray(parameters, dtype=float)
    fast, slow = (numpy.asarray(table, dtype=float) for table in (passed_fast, passed_slow))
    if fast.ndim != 2 or fast.shape != slow.shape or all_parameters.shape[:1] != fast.shape[:1]:
        raise FoldcarError("a correction needs two tables of designs and environments that are alike, and parameters")
    present = numpy.isfinite(fast).any(axis=1)
    fast, slow, x = fast[present], slow[present], all_parameters[present]
    counted = numpy.isfinite(fast).sum(axis=1)
    simulated = smoothed_simulation(x, numpy.column_stack([numpy.nansum(fast, axis=1), counted]), fast)
    fast_rate, low, high = simulated.rates(confidence).T
    difference, variance = _differences(x, slow - fast)
    quantile = ndtri((1 + confidence) / 2)
    # The variances of the smoothed rate and of the difference add up.
    half_width = quantile * numpy.sqrt(variance + ((high - low) / (2 * quantile)) ** 2)
    rate = fast_rate + difference
    result = numpy.full((3, len(present)), numpy.nan)
    result[:, present] = numpy.clip([rate, rate - half_width, rate + half_width], 0, 1)
    return result[0], result[1], result[2]


def _differences(parameters: NDArray[Any], table: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Estimate the true differences of both simulations' rates: mean and variance, each (designs,).

    ``parameters`` are (designs, k); ``table`` (designs, environments) has the difference of each pair of runs, NaN
    without a pair. The formulas are those of :func:`corrected_rates`, averaged over candidates for K by their evidence.
    """
    table = table[:, numpy.isfinite(table).any(axis=0)]
    if table.shape[1] < 2:
        raise FoldcarError("a correction needs runs in both simulations in two environments or more")
    paired = numpy.isfinite(table).any(axis=1)
    counted = numpy.isfinite(table[paired]).sum(axis=1)
    means = numpy.nanmean(table[paired], axis=1)
    residuals = numpy.where(numpy.isfinite(table[paired]), table[paired] - means[:, None], 0.0)
    squares = (residuals**2).sum(axis=1)
    pooled_variance = max(squares.sum() / max(counted.sum() - len(counted), 1), MIN_VARIANCE)
    # Variance of the differences of each design, as if it had POOLED_RUNS further runs with the pooled variance.
    own_variances = (squares + POOLED_RUNS * pooled_variance) / (numpy.maximum(counted - 1, 0) + POOLED_RUNS)
    environments = table.shape[1]
    # The variance over environments of the designs' mean residual, less what independent designs would cause.
    shared_variance = (residuals.mean(axis=0) ** 2).sum() / (environments - 1) - pooled_variance / len(means)
    noise = numpy.diag(own_variances / counted) + max(shared_variance, 0.0) / environments
    scaled, evidence, estimates, variances = unit_range(parameters), [], [], []
    for length in LENGTHS.get(parameters.shape[1], MANY_LENGTHS):
        smooth = Matern(scaled, length).covariance(scaled, scaled)
        for strength, alone in product(SMOOTH_DIFFERENCES, OWN_DIFFERENCES):
            prior = MEAN_DIFFERENCE**2 + strength**2 * smooth + alone**2 * numpy.eye(len(parameters))
            covariance = prior[numpy.ix_(paired, paired)] + noise
            # (designs, paired designs): K (K + S)^-1
            gain = numpy.linalg.solve(covariance, prior[paired]).T
            fit = numpy.linalg.solve(covariance, means)
            evidence.append(-0.5 * (means @ fit + numpy.linalg.slogdet(covariance)[1]))
            estimates.append(gain @ means)
            variances.append(numpy.diag(prior) - (gain * prior[:, paired]).sum(axis=1))
    weights = evidence_weights(evidence)
    mean = weights @ numpy.array(estimates)
    return mean, weights @ (numpy.array(variances) + (numpy.array(estimates) - mean) ** 2)
