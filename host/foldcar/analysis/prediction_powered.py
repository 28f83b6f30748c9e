"""A success rate from few trials and many simulated runs (Angelopoulos et al. 2023, 2301.09633; PPI++, 2311.01453).

The estimate is that of PPI++: the trials' mean, corrected by how much easier or harder than all environments the trials'
own were to simulation. The interval is Bayesian, since normal ones cover too little at ten trials: a trial's log-odds of
passing go linearly from those of a where simulation fails to those of b where it passes; a and b have Jeffreys' prior.
The rate is the mean over all environments, simulated only or tried. With results 0 and 1 this is the table of two by two,
without other assumptions; with rates between, the logistic link keeps the mean right where the line does not fit.
Without other runs it is Jeffreys' interval of the trials.
"""

from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.rate import Rate, check_confidence, jeffreys_interval
from foldcar.errors import FoldcarError

# Nodes of a and of b: midpoints of equal parts of the angles whose squared sine they are; Jeffreys' prior is flat there.
NODES = 48
# Nodes of the error of a mean over environments: midpoints of equal parts of the normal distribution, of variance 1.
MEAN_NODES = 11
# Groups that differing results of simulation are sorted into.
GROUPS = 24


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
    covariance = (y * f).mean() - y.mean() * f.mean()
    weight = covariance / ((1 + len(f) / len(other)) * spread) if spread > 0 else 0.0
    weight = min(max(float(weight), 0.0), 1.0)
    return float(weight * other.mean() + (y - weight * f).mean())


def _interval(passed: NDArray[Any], paired: NDArray[Any], every: NDArray[Any], confidence: float) -> tuple[float, float]:
    """The posterior's interval of the mean of the trials' probability over all environments."""
    from scipy.stats import norm

    results, group, counts = _groups(every)
    successes = numpy.bincount(group[: len(paired)], weights=passed, minlength=len(results))
    failures = numpy.bincount(group[: len(paired)], minlength=len(results)) - successes
    # Twice narrowed to the angles where the likelihood is above e^-18 of its highest.
    box = numpy.array([[0.0, numpy.pi / 2]] * 2)
    for _ in range(3):
        steps = numpy.ptp(box, axis=1) / NODES
        angles = box[:, :1] + steps[:, None] * (numpy.arange(NODES) + 0.5)
        ends = 2 * numpy.log(numpy.tan(angles))
        log_odds = ends[0][:, None, None] * (1 - results) + ends[1][None, :, None] * results
        probability = 1 / (1 + numpy.exp(-log_odds))
        logs = numpy.log(probability) @ successes + numpy.log1p(-probability) @ failures
        weights = numpy.exp(logs - logs.max())
        likely = weights > numpy.exp(-18)
        for axis in range(2):
            inside = angles[axis][likely.any(axis=1 - axis)]
            box[axis] = numpy.clip([inside.min() - steps[axis], inside.max() + steps[axis]], 0, numpy.pi / 2)
    share = counts / len(every)
    means = probability @ share
    errors = numpy.sqrt(numpy.maximum(probability**2 @ share - means**2, 0) / len(every))
    normal = norm.ppf((numpy.arange(MEAN_NODES) + 0.5) / MEAN_NODES)
    rates = (means[..., None] + errors[..., None] * normal / normal.std()).ravel()
    order = numpy.argsort(rates)
    masses = numpy.repeat(weights.ravel(), MEAN_NODES)[order].cumsum()
    tail = (1 - confidence) / 2
    low, high = numpy.interp([tail * masses[-1], (1 - tail) * masses[-1]], masses, rates[order])
    return max(float(low), 0.0), min(float(high), 1.0)


def _groups(every: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Results sorted into at most GROUPS: the groups' mean results, each result's group, the groups' numbers."""
    edges = numpy.unique(every)
    if len(edges) > GROUPS:
        edges = numpy.unique(numpy.quantile(every, numpy.arange(GROUPS) / GROUPS))
    group = numpy.searchsorted(edges, every, side="right") - 1
    counts = numpy.bincount(group)
    return numpy.bincount(group, weights=every) / counts, group, counts


def _checked(name: str, values: ArrayLike) -> NDArray[Any]:
    """A list of values from 0 to 1 as an array."""
    found = numpy.asarray(values, dtype=float)
    if found.ndim != 1 or not numpy.all((found >= 0) & (found <= 1)):
        raise FoldcarError(f"{name} must be a list of values from 0 to 1")
    return found
