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

# Nodes of a and of b: midpoints of equal parts of Beta(1/2, 1/2).
NODES = numpy.sin(numpy.pi * (numpy.arange(128) + 0.5) / 256) ** 2
# Nodes of the mean of f: midpoints of equal parts of its normal distribution.
MEAN_NODES = 9


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

    a, b = NODES[:, None], NODES[None, :]
    logs = numpy.zeros((len(NODES), len(NODES)))
    for result in numpy.unique(paired):
        here = passed[paired == result]
        probability = a + (b - a) * result
        logs += here.sum() * numpy.log(probability) + (len(here) - here.sum()) * numpy.log1p(-probability)
    weights = numpy.exp(logs - logs.max())
    error = every.std(ddof=1) / numpy.sqrt(len(every))
    steps = norm.ppf((numpy.arange(MEAN_NODES) + 0.5) / MEAN_NODES)
    means = numpy.clip(every.mean() + error * steps, 0, 1)
    rates = (a[..., None] + (b - a)[..., None] * means).ravel()
    order = numpy.argsort(rates)
    masses = numpy.repeat(weights.ravel(), MEAN_NODES)[order].cumsum()
    tail = (1 - confidence) / 2
    found = numpy.searchsorted(masses, [tail * masses[-1], (1 - tail) * masses[-1]])
    low, high = rates[order][found]
    return float(low), float(high)


def _checked(name: str, values: ArrayLike) -> NDArray[Any]:
    """A list of values from 0 to 1 as an array."""
    found = numpy.asarray(values, dtype=float)
    if found.ndim != 1 or not numpy.all((found >= 0) & (found <= 1)):
        raise FoldcarError(f"{name} must be a list of values from 0 to 1")
    return found
