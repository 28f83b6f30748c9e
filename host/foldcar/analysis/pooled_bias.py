"""Success rates of many designs from few trials of each: the difference of trials and simulation is smooth.

On the log-odds scale a design's rate is simulation's plus a difference, which is a Gaussian process over the designs'
parameters: a constant, a slope on simulation's own log-odds, a smooth part (Matérn 5/2) and one of each design alone
(Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294, with binomial trials). How strong and how smooth it is, is
averaged over a grid by the evidence, so that rough differences pool little. Rasmussen and Williams 2006, section 3.6,
gives the inference (expectation propagation); the interval is that of the tilted distributions, without a normal
approximation of a design's own trials.
"""

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence, jeffreys_interval
from foldcar.analysis.rate import Rate
from foldcar.errors import FoldcarError

# Standard deviations, on the log-odds scale, of the constant difference and of its slope on simulation's log-odds.
CONSTANT, SLOPE = 1.5, 0.5
# The grid: standard deviation and length (as a part of the parameters' range) of the smooth part; of one design's own.
SMOOTH = (0.2, 0.7, 2.0)
LENGTHS = (0.15, 0.4, 1.0)
ALONE = (0.1, 0.6, 1.3)
SWEEPS = 30
# Designs with trials that are pooled at most: 200 take a second, and the work grows with the cube of their number.
MOST_POOLED = 200
QUADRATURE = numpy.polynomial.hermite_e.hermegauss(21)
# Log-odds at which posteriors are tabulated, 1e-4 to 1 - 1e-4.
LOG_ODDS = numpy.linspace(-9.2, 9.2, 921)


def pooled_rates(
    parameters: ArrayLike,
    passed: ArrayLike,
    counted: ArrayLike,
    simulated: ArrayLike,
    confidence: float = 0.95,
    simulated_runs: ArrayLike = 100,
) -> list[Rate]:
    """The rate of each design (d,) from ``passed`` of ``counted`` trials, and its simulated rate of ``simulated_runs``.

    ``parameters`` are (d, k). Designs without trials get a rate from their neighbours'. With trials of one design only
    there is nothing to pool: that one gets Jeffreys' interval, the others 0 to 1.
    """
    check_confidence(confidence)
    x, k, n, log_odds, errors = _checked(parameters, passed, counted, simulated, simulated_runs)
    if numpy.count_nonzero(n) < 2:
        return [_unpooled(float(a), float(b), confidence) for a, b in zip(k, n, strict=True)]
    fit = _Fit.to(_kernels(x, log_odds, errors), log_odds, k, n)
    tail = (1 - confidence) / 2
    rates = []
    for design in range(len(n)):
        cumulative = fit.posterior(design).cumsum()
        points = numpy.interp([tail, 0.5, 1 - tail], cumulative / cumulative[-1], LOG_ODDS)
        low, middle, high = (float(value) for value in 1 / (1 + numpy.exp(-points)))
        own = f"{n[design]:g} trials" if n[design] else "no trials"
        method = f"{own} of this design, {n.sum() - n[design]:g} of others, differences to simulation pooled"
        rates.append(Rate(middle, low, high, confidence, method))
    return rates


def _unpooled(passed: float, counted: float, confidence: float) -> Rate:
    if not counted:
        return Rate(0.5, 0.0, 1.0, confidence, "no trials of this design, of one other at most: nothing is known")
    low, high = jeffreys_interval(passed, counted, confidence)
    return Rate(passed / counted, low, high, confidence, "Jeffreys interval of the trials alone (no others to pool)")


def _kernels(x: NDArray[Any], log_odds: NDArray[Any], errors: NDArray[Any]) -> NDArray[Any]:
    """The covariances (h, d, d) of the differences for each point of the grid; ``errors`` are simulation's variances."""
    span = numpy.ptp(x, axis=0)
    scaled = x / numpy.where(span > 0, span, 1.0)
    distances = numpy.sqrt(((scaled[:, None] - scaled[None, :]) ** 2).sum(axis=-1))
    common = CONSTANT**2 + SLOPE**2 * numpy.outer(log_odds, log_odds) + numpy.diag(errors)
    found = []
    for length in LENGTHS:
        r = numpy.sqrt(5) * distances / length
        smooth = (1 + r + r**2 / 3) * numpy.exp(-r)
        found += [common + a**2 * smooth + b**2 * numpy.eye(len(x)) for a in SMOOTH for b in ALONE]
    return numpy.array(found)


@dataclass(frozen=True)
class _Fit:
    """What is left of expectation propagation: cavities (h, d), and the grid's weights (h,)."""

    means: NDArray[Any]
    variances: NDArray[Any]
    weights: NDArray[Any]
    passed: NDArray[Any]
    counted: NDArray[Any]

    @classmethod
    def to(cls, kernels: NDArray[Any], log_odds: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]) -> "_Fit":
        """Fit latent log-odds with prior mean ``log_odds`` to the trials, for all kernels at once."""
        grid, designs = kernels.shape[:2]
        prior_mean = numpy.broadcast_to(log_odds, (grid, designs))
        # Each design's trials as a normal observation of its log-odds: precision, and precision times value less prior.
        precision = numpy.full((grid, designs), 1e-6) + counted / 8
        shift = numpy.zeros((grid, designs))
        for _ in range(SWEEPS):
            variance, mean = _posterior(kernels, precision, shift)
            cavity_variance = 1 / numpy.maximum(1 / variance - precision, 1e-6)
            cavity_mean = cavity_variance * (mean / variance - shift)
            evidence, tilted_mean, tilted_variance = _tilted(
                cavity_mean + prior_mean, cavity_variance, passed, counted
            )
            new = numpy.maximum(1 / tilted_variance - 1 / cavity_variance, 1e-6)
            new_shift = (tilted_mean - prior_mean) / tilted_variance - cavity_mean / cavity_variance
            change = numpy.abs(new - precision).max()
            precision, shift = 0.2 * precision + 0.8 * new, 0.2 * shift + 0.8 * new_shift
            if change < 1e-3:
                break
        return cls(
            cavity_mean + prior_mean,
            cavity_variance,
            _weights(kernels, precision, shift, cavity_mean, cavity_variance, evidence),
            passed,
            counted,
        )

    def posterior(self, design: int) -> NDArray[Any]:
        """The density of a design's log-odds at LOG_ODDS, up to a factor."""
        means, variances = self.means[:, design, None], self.variances[:, design, None]
        logs = -((LOG_ODDS - means) ** 2) / (2 * variances) + _log_likelihood(
            LOG_ODDS, self.passed[design], self.counted[design]
        )
        density = numpy.exp(logs - logs.max(axis=1, keepdims=True))
        mixture: NDArray[Any] = self.weights @ (density / density.sum(axis=1, keepdims=True))
        return mixture


def _posterior(kernels: NDArray[Any], precision: NDArray[Any], shift: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Variances and means (h, d) of the differences given the normal observations."""
    root = numpy.sqrt(precision)
    inner = numpy.eye(kernels.shape[1]) + root[:, :, None] * kernels * root[:, None, :]
    half = numpy.linalg.solve(inner, root[:, :, None] * kernels)
    covariance = kernels - (kernels * root[:, None, :]) @ half
    return numpy.diagonal(covariance, axis1=1, axis2=2), (covariance @ shift[..., None])[..., 0]


def _tilted(
    mean: NDArray[Any], variance: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]
) -> tuple[Any, Any, Any]:
    """Log of the mass, mean and variance (h, d) of normal times binomial likelihood, by nodes about its highest point."""
    mode = numpy.where(counted > 0, numpy.log((passed + 0.5) / (counted - passed + 0.5)), mean)
    for _ in range(12):
        rate = 1 / (1 + numpy.exp(-mode))
        curvature = 1 / variance + counted * rate * (1 - rate)
        mode = mode + numpy.clip((passed - counted * rate - (mode - mean) / variance) / curvature, -2, 2)
    scale = 1 / numpy.sqrt(curvature)[..., None]
    nodes, weights = QUADRATURE
    points = mode[..., None] + scale * nodes
    logs = _log_likelihood(points, passed[:, None], counted[:, None]) + nodes**2 / 2
    logs -= (points - mean[..., None]) ** 2 / (2 * variance[..., None])
    top = logs.max(axis=-1, keepdims=True)
    masses = weights * numpy.exp(logs - top) * scale / numpy.sqrt(variance)[..., None]
    total = masses.sum(axis=-1)
    first = (masses * points).sum(axis=-1) / total
    second = (masses * (points - first[..., None]) ** 2).sum(axis=-1) / total
    return numpy.log(total / weights.sum()) + top[..., 0], first, second


def _log_likelihood(log_odds: NDArray[Any], passed: Any, counted: Any) -> NDArray[Any]:
    found: NDArray[Any] = passed * log_odds - counted * numpy.logaddexp(0, log_odds)
    return found


def _weights(
    kernels: NDArray[Any],
    precision: NDArray[Any],
    shift: NDArray[Any],
    cavity_mean: NDArray[Any],
    cavity_variance: NDArray[Any],
    evidence: NDArray[Any],
) -> NDArray[Any]:
    """The grid's posterior weights (h,): the approximate evidence of each kernel, all alike beforehand."""
    observed, noise = shift / precision, 1 / precision
    spread = cavity_variance + noise
    sites = evidence + 0.5 * numpy.log(spread) + (observed - cavity_mean) ** 2 / (2 * spread)
    total = kernels + noise[:, :, None] * numpy.eye(kernels.shape[1])
    _, determinant = numpy.linalg.slogdet(total)
    fit = (observed * numpy.linalg.solve(total, observed[..., None])[..., 0]).sum(axis=1)
    logs = sites.sum(axis=1) - 0.5 * determinant - 0.5 * fit
    weights = numpy.exp(logs - logs.max())
    shares: NDArray[Any] = weights / weights.sum()
    return shares


def _checked(
    parameters: ArrayLike, passed: ArrayLike, counted: ArrayLike, simulated: ArrayLike, simulated_runs: ArrayLike
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Parameters (d, k), passed, counted, and simulation's log-odds with their variances (d,).

    Half a run is added to both outcomes (Haldane 1956), so that log-odds are finite where all or no runs passed.
    """
    x = numpy.asarray(parameters, dtype=float)
    if x.ndim != 2:
        raise FoldcarError(f"parameters of designs must be a table of designs by parameters; it has {x.ndim} dimensions")
    columns = [numpy.asarray(values, dtype=float) for values in (passed, counted, simulated)]
    if any(values.shape != (len(x),) for values in columns):
        raise FoldcarError(f"pooled rates need passed, counted and simulated of each of the {len(x)} designs")
    k, n, rate = columns
    if not (numpy.all(numpy.isfinite(x)) and numpy.all((k >= 0) & (k <= n)) and numpy.all((rate >= 0) & (rate <= 1))):
        raise FoldcarError("pooled rates need finite parameters, 0 ≤ passed ≤ counted, and simulated rates from 0 to 1")
    runs = numpy.broadcast_to(numpy.asarray(simulated_runs, dtype=float), rate.shape)
    if not numpy.all(runs >= 1):
        raise FoldcarError("pooled rates need at least 1 simulated run of each design")
    successes, failures = rate * runs + 0.5, (1 - rate) * runs + 0.5
    return x, k, n, numpy.log(successes / failures), 1 / successes + 1 / failures
