"""A success rate from few trials and many simulated runs (Angelopoulos et al. 2023, 2301.09633; PPI++, 2311.01453).

The estimate is that of PPI++: the trials' mean, corrected by how much easier or harder than all environments the trials'
own were to simulation. The interval is Bayesian, as normal ones cover too little at ten trials: trials pass with rate a
where simulation fails and b where it passes, each with Jeffreys' prior, and the rate is their mean over all environments,
simulated only or tried. Without other runs it is Jeffreys' interval of the trials.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.rate import Rate, check_confidence, jeffreys_interval
from foldcar.errors import FoldcarError

# Nodes of a and b, and of the share of environments in which simulation passes: midpoints of equal parts of each.
NODES, SHARE_NODES = 100, 11


def rectified_rate(trials: ArrayLike, paired_runs: ArrayLike, other_runs: ArrayLike, confidence: float = 0.95) -> Rate:
    """The rate at which trials pass, each 0 or 1 (n,), with simulation's results in the same environments (n,).

    ``other_runs`` (N,) are simulation's results in environments without a trial. Results are 0 or 1. All environments are
    independent samples of one distribution.
    """
    check_confidence(confidence)
    passed, paired, other = (
        _checked(name, values)
        for name, values in (("trials", trials), ("paired runs", paired_runs), ("other runs", other_runs))
    )
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
    covariance = (y * f).mean() - y.mean() * f.mean()
    weight = covariance / ((1 + len(f) / len(other)) * spread) if spread > 0 else 0.0
    weight = min(max(float(weight), 0.0), 1.0)
    return float(weight * other.mean() + (y - weight * f).mean())


def _interval(passed: NDArray[Any], paired: NDArray[Any], every: NDArray[Any], confidence: float) -> tuple[float, float]:
    """The posterior's interval of the mean of the trials' probability over all environments."""
    from scipy.stats import beta, norm

    parts = (numpy.arange(NODES) + 0.5) / NODES
    counts = [(passed[paired == result].sum(), (paired == result).sum()) for result in (0, 1)]
    a, b = (beta.ppf(parts, k + 0.5, n - k + 0.5) for k, n in counts)
    share = every.mean()
    normal = norm.ppf((numpy.arange(SHARE_NODES) + 0.5) / SHARE_NODES)
    shares = share + numpy.sqrt(share * (1 - share) / len(every)) * normal / normal.std()
    rates = a[:, None, None] + (b[:, None] - a[:, None, None]) * shares
    low, high = numpy.quantile(rates, [(1 - confidence) / 2, (1 + confidence) / 2])
    return max(float(low), 0.0), min(float(high), 1.0)


def _checked(name: str, values: ArrayLike) -> NDArray[Any]:
    """A list of results as an array."""
    found = numpy.asarray(values, dtype=float)
    if found.ndim != 1 or not numpy.all((found == 0) | (found == 1)):
        raise FoldcarError(f"{name} must be a list of results, each 0 or 1")
    return found
