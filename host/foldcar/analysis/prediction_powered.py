"""A success rate from few trials and many simulated runs (Angelopoulos et al. 2023, 2301.09633; PPI++, 2311.01453).

The estimate is that of PPI++: the trials' mean, corrected by how much easier or harder than all environments the trials'
own were to simulation. The interval is Bayesian, since normal ones cover too little at ten trials: a trial passes with
probability a + (b - a) f, where f is simulation's result in its environment; a and b have Jeffreys' prior, and the mean
of f over all environments is nearly known. Without other runs it is Jeffreys' interval of the trials.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence, jeffreys_interval
from foldcar.analysis.rate import Rate
from foldcar.errors import FoldcarError

# Nodes of a and of b: midpoints of equal parts of the angles whose squared sine they are; Jeffreys' prior is flat there.
NODES = 48
# Nodes of the mean of f: midpoints of equal parts of its normal distribution, scaled to its variance.
MEAN_NODES = 11


def rectified_rate(trials: ArrayLike, paired_runs: ArrayLike, other_runs: ArrayLike, confidence: float = 0.95) -> Rate:
    """The rate at which trials pass, each 0 or 1 (n,), with simulation's results in the same environments (n,).

    ``other_runs`` (N,) are simulation's results in environments without a trial. Results are 0, 1 or rates between. All
    environments are independent samples of one distribution.
    """
    check_confidence(confidence)
    passed = _checked("trials", trials)
    paired = _checked("paired runs", paired_runs)
    other = _checked("other runs", other_runs)
    if not numpy.all((passed == 0) | (passed == 1)):
        raise FoldcarError("trials must be 0 or 1 each")
    if len(passed) != len(paired):
        raise FoldcarError(f"each trial needs the run of its environment: {len(passed)} trials, {len(paired)} runs")
    if not len(passed):
        return Rate(0.5, 0.0, 1.0, confidence, "no trials: nothing is known")
    if not len(other) or numpy.ptp(paired) == 0:
        why = "simulation says the same in all of their environments" if len(other) else "no other simulated runs"
        low, high = jeffreys_interval(float(passed.sum()), len(passed), confidence)
        return Rate(float(passed.mean()), low, high, confidence, f"Jeffreys interval of the trials alone ({why})")
    low, high = _interval(passed, paired, numpy.concatenate([paired, other]), confidence)
    value = float(numpy.clip(power_tuned_mean(passed, paired, other), low, high))
    return Rate(value, low, high, confidence, f"{len(passed)} trials rectify {len(other)} simulated runs")


def power_tuned_mean(trials: ArrayLike, paired_runs: ArrayLike, other_runs: ArrayLike) -> float:
    """The PPI++ estimate of the trials' mean, its weight of simulation limited to 0 to 1; arrays as above."""
    y, f, other = (numpy.asarray(values, dtype=float) for values in (trials, paired_runs, other_runs))
    spread = numpy.concatenate([f, other]).var(ddof=1)
    weight = numpy.cov(y, f)[0, 1] / ((1 + len(f) / len(other)) * spread) if len(f) > 1 and spread > 0 else 0.0
    weight = min(max(float(weight), 0.0), 1.0)
    return float(weight * other.mean() + (y - weight * f).mean())


def _interval(passed: NDArray[Any], paired: NDArray[Any], every: NDArray[Any], confidence: float) -> tuple[float, float]:
    """The posterior's interval of a + (b - a) mean(f)."""
    from scipy.stats import norm

    results, which = numpy.unique(paired, return_inverse=True)
    successes = numpy.bincount(which, weights=passed)
    failures = numpy.bincount(which) - successes
    # Twice narrowed to the angles where the likelihood is above e^-18 of its highest.
    box = numpy.array([[0.0, numpy.pi / 2]] * 2)
    for _ in range(3):
        steps = numpy.ptp(box, axis=1) / NODES
        angles = box[:, :1] + steps[:, None] * (numpy.arange(NODES) + 0.5)
        a, b = numpy.sin(angles) ** 2
        weights = _likelihood(a[:, None], b[None, :], results, successes, failures)
        likely = weights > numpy.exp(-18)
        for axis in range(2):
            inside = angles[axis][likely.any(axis=1 - axis)]
            box[axis] = numpy.clip([inside.min() - steps[axis], inside.max() + steps[axis]], 0, numpy.pi / 2)
    error = every.std(ddof=1) / numpy.sqrt(len(every))
    normal = norm.ppf((numpy.arange(MEAN_NODES) + 0.5) / MEAN_NODES)
    means = every.mean() + error * normal / normal.std()
    rates = (a[:, None, None] + (b[None, :, None] - a[:, None, None]) * numpy.clip(means, 0, 1)).ravel()
    order = numpy.argsort(rates)
    masses = numpy.repeat(weights.ravel(), MEAN_NODES)[order].cumsum()
    tail = (1 - confidence) / 2
    low, high = numpy.interp([tail * masses[-1], (1 - tail) * masses[-1]], masses, rates[order])
    return float(low), float(high)


def _likelihood(
    a: NDArray[Any], b: NDArray[Any], results: NDArray[Any], successes: NDArray[Any], failures: NDArray[Any]
) -> NDArray[Any]:
    """The likelihood on the grid of a and b, 1 at its highest."""
    logs = numpy.zeros(numpy.broadcast_shapes(a.shape, b.shape))
    for result, passed, failed in zip(results, successes, failures, strict=True):
        probability = a + (b - a) * result
        logs += passed * numpy.log(probability) + failed * numpy.log1p(-probability)
    likelihood: NDArray[Any] = numpy.exp(logs - logs.max())
    return likelihood


def _checked(name: str, values: ArrayLike) -> NDArray[Any]:
    """A list of values from 0 to 1 as an array."""
    found = numpy.asarray(values, dtype=float)
    if found.ndim != 1 or not numpy.all((found >= 0) & (found <= 1)):
        raise FoldcarError(f"{name} must be a list of values from 0 to 1")
    return found
