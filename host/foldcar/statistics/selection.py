"""Select which designs to build first, which to try next, how many trials they need, and in which environments.

A design is feasible if its simulated rate reaches the threshold. The first designs mark the feasible region. An edge is a
feasible design with an infeasible neighbour. The middle is the feasible design farthest from all infeasible ones and from
the ends of the range. Later designs are chosen by draws of the true rates (:mod:`foldcar.statistics.pooled_bias`).
"""

import math
from bisect import bisect_left
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.built_cars import centre_factor
from foldcar.statistics.gaussian_process import unit_range

MIDDLE, LOWER_EDGE, UPPER_EDGE, EDGE, BELOW, ABOVE, OUTSIDE, BEST, END = (
    "middle", "lower edge", "upper edge", "edge", "below", "above", "outside", "best", "end of the range",
)  # fmt: skip
# Largest number of trials that is advised.
MAX_TRIALS = 10_000
# Largest number of trials of one car that are planned for each independent trial that is wanted.
MAX_EACH = 10
# In a family of fewer designs each counts as one of MIN_DESIGNS. Gains are computed from at most MAX_WEIGHED draws.
MIN_DESIGNS, MAX_WEIGHED = 20, 240_000
# Numbers of further independent trials of one design that are compared by their gain.
BATCHES = (10, 40)
# The normal quantile of 0.975.
Z = 1.959963984540054


@dataclass(frozen=True)
class Placed:
    """A design, by its index, and its place in the feasible region: one of MIDDLE, LOWER_EDGE, … of this module."""

    index: int
    place: str


def first_designs(parameters: ArrayLike, rates: ArrayLike, uncertainty: ArrayLike, threshold: float) -> list[Placed]:
    """Choose the designs to build before there are trials, the most useful first.

    ``parameters`` (designs, k); ``rates`` (designs,) of simulation and ``threshold``, 0 to 1; ``uncertainty`` (designs,)
    of the border at each design. The order is: the middle, the edge with the more uncertain border, designs outside on
    both sides, the other edge. If no design is feasible, the best is chosen. If all are, the middle and the ends of the
    range.
    """
    values, rate, doubt = (numpy.asarray(array, dtype=float) for array in (parameters, rates, uncertainty))
    feasible, unit = rate >= threshold, unit_range(values)
    if not feasible.any():
        return [Placed(int(numpy.argmax(rate)), BEST)]
    # The largest distance of neighbouring values of each parameter.
    step = numpy.array([numpy.diff(numpy.unique(column)).max(initial=0.0) for column in unit.T])
    middle = _middle(unit, feasible, step)
    if feasible.all():
        sums = unit.sum(axis=1)
        ends = dict.fromkeys(index for index in (int(sums.argmin()), int(sums.argmax())) if index != middle)
        return [Placed(middle, MIDDLE), *(Placed(index, END) for index in ends)]
    edges = _opposite_pair(_edges(unit, feasible, step), doubt, unit, middle)
    # Outside, rates near half the threshold: not hopeless, and yet clearly infeasible.
    outside = _opposite_pair(numpy.flatnonzero(~feasible), -numpy.abs(rate - threshold / 2), unit, middle, edges[:1])
    varied = numpy.flatnonzero(numpy.ptp(values, axis=0) > 0)

    def place(index: int, low: str, high: str, either: str) -> Placed:
        """Place a design by its side of the middle, ``low`` or ``high``; ``either`` if several parameters vary."""
        if len(varied) != 1:
            return Placed(index, either)
        return Placed(index, low if values[index, varied[0]] < values[middle, varied[0]] else high)

    at_edge = [place(index, LOWER_EDGE, UPPER_EDGE, EDGE) for index in edges]
    beyond = [place(index, BELOW, ABOVE, OUTSIDE) for index in outside]
    by_index: dict[int, Placed] = {}
    for placed in (Placed(middle, MIDDLE), *at_edge[:1], *beyond, *at_edge[1:]):
        by_index.setdefault(placed.index, placed)
    return list(by_index.values())


def _middle(unit: NDArray[Any], feasible: NDArray[Any], step: NDArray[Any]) -> int:
    """Return the index of the feasible design that is farthest from infeasible ones and from the ends of the range.

    ``unit`` (designs, k) are the parameters scaled to 0 to 1, ``feasible`` (designs,) is a mask, ``step`` (k,) the
    largest distance of neighbouring values.
    """
    # One step outside the range, as if the designs there were infeasible.
    ends = numpy.minimum(unit, 1 - unit) + step
    # A parameter that does not vary has no ends.
    depth = numpy.where(numpy.ptp(unit, axis=0) > 0, ends, numpy.inf).min(axis=1, initial=numpy.inf)
    depth = numpy.minimum(depth, _distances(unit, unit[~feasible]).min(axis=1, initial=numpy.inf))
    depth = numpy.where(feasible, depth, -numpy.inf)
    # Of equally deep designs take the central one.
    best = numpy.flatnonzero(depth >= depth.max() - 1e-9)
    return int(best[len(best) // 2])


def _edges(unit: NDArray[Any], feasible: NDArray[Any], step: NDArray[Any]) -> NDArray[Any]:
    """Return the indices of feasible designs with an infeasible neighbour, one step away along one parameter.

    ``unit`` (designs, k) are the parameters scaled to 0 to 1, ``feasible`` (designs,) is a mask, ``step`` (k,) the
    largest distance of neighbouring values.
    """
    inside, others = numpy.flatnonzero(feasible), unit[~feasible]
    differences = numpy.abs(unit[inside][:, None] - others[None, :])
    near = ((differences <= 1.01 * step).all(axis=2) & ((differences > 1e-9).sum(axis=2) == 1)).any(axis=1)
    # A grid with gaps may lack neighbours: then take the feasible design nearest to an infeasible one.
    return inside[near] if near.any() else inside[[int(_distances(unit[inside], others).min(axis=1).argmin())]]


def _distances(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """Return the Euclidean distances (m, n) between points (m, k) and (n, k)."""
    return numpy.asarray(numpy.sqrt(((first[:, None] - second[None, :]) ** 2).sum(axis=2)))


def _opposite_pair(
    indices: NDArray[Any], score: NDArray[Any], unit: NDArray[Any], middle: int, apart_from: Sequence[int] = ()
) -> list[int]:
    """Choose two designs with the highest ``score`` (designs,) that lie on opposite sides of the design ``middle``.

    ``indices`` are the designs to choose from, ``unit`` (designs, k) their scaled parameters. The first choice lies
    opposite the last of ``apart_from``, if possible.
    """
    chosen: list[int] = []
    previous = list(apart_from)
    for _ in range(min(2, len(indices))):
        candidates = numpy.array([index for index in indices if index not in chosen])
        if previous:
            opposite = (unit[candidates] - unit[middle]) @ (unit[previous[-1]] - unit[middle]) < 0
            candidates = candidates[opposite] if opposite.any() else candidates
        chosen.append(int(candidates[score[candidates].argmax()]))
        previous = list(chosen)
    return chosen


@dataclass(frozen=True)
class Value:
    """The expected gain from more trials of each design (designs,), 0 to 1.

    ``choice`` is the gain in the rate of the design believed best (the knowledge gradient, Frazier, Powell and Dayanik
    2008). ``threshold`` is the decrease of the fraction of designs put on the wrong side of the threshold.
    """

    choice: NDArray[Any]
    threshold: NDArray[Any]


def value_of_trials(draws: ArrayLike, threshold: float, trials: int, zone: float = 0.0) -> Value:
    """Compute the expected gain of ``trials`` further trials of each design, from ``draws`` (draws, designs) of its rate.

    For each possible number of passed trials the draws are weighted by its binomial probability; the decisions under
    these weights are compared with the decisions now. A design within ``zone`` of the threshold (0 to 1) cannot be on the
    wrong side.
    """
    from scipy.special import gammaln

    rates = numpy.asarray(draws, dtype=float)
    above, below = (rates >= threshold + zone).astype(float), (rates < threshold - zone).astype(float)
    best_now = numpy.max(rates.mean(axis=0))
    # The probability that a design is judged wrongly against the threshold now, averaged over designs.
    wrong_now = numpy.minimum(above.mean(axis=0), below.mean(axis=0)).mean()
    choice_gain, threshold_gain = numpy.zeros(rates.shape[1]), numpy.zeros(rates.shape[1])
    decision_values, clipped = numpy.hstack([rates, above, below]), rates.clip(1e-12, 1 - 1e-12)
    passed = numpy.arange(trials + 1)[:, None]
    log_ways = gammaln(trials + 1) - gammaln(passed + 1) - gammaln(trials - passed + 1)
    for design, (log_pass, log_fail) in enumerate(zip(numpy.log(clipped).T, numpy.log1p(-clipped).T, strict=True)):
        # The joint probability of each number of passed trials (rows) and each draw (columns).
        chance = numpy.exp(log_ways + passed * log_pass + (trials - passed) * log_fail) / len(rates)
        # (trials + 1, 3, designs): expected rate, and probabilities to be above and below.
        expected = (chance @ decision_values).reshape(trials + 1, 3, -1)
        choice_gain[design] = expected[:, 0].max(axis=1).sum() - best_now
        threshold_gain[design] = wrong_now - numpy.minimum(expected[:, 1], expected[:, 2]).sum(axis=0).mean()
    # Rounding may leave tiny negative gains.
    return Value(choice_gain.clip(0), threshold_gain.clip(0))


def gain_per_hour(draws: ArrayLike, threshold: float, zone: float, work_min: ArrayLike) -> float:
    """Return the greatest expected gain of an hour of work, 0 to 1, over designs and numbers of trials (BATCHES).

    ``draws`` (draws, designs) are of the rates; ``zone`` as in :func:`value_of_trials`. ``work_min`` (BATCHES, designs)
    are the minutes for that many independent trials, with the building of cars (:func:`least_effort`). Several numbers
    of trials are compared, because one trial may be worth nothing where many are worth something (Frazier and Powell
    2010, doi:10.1287/deca.1100.0188).
    """
    rates, gains = numpy.asarray(draws, dtype=float), []
    designs = rates.shape[1]
    # For many designs a part of the draws is enough.
    thinned_rates = rates[:: max(1, rates.size // MAX_WEIGHED)]
    for trials, minutes in zip(BATCHES, numpy.asarray(work_min), strict=True):
        value = value_of_trials(thinned_rates, threshold, trials, zone)
        # The gain at the threshold is a fraction of the family; a small family counts as one of MIN_DESIGNS designs.
        worth = value.choice + value.threshold * designs / max(designs, MIN_DESIGNS)
        gains.append((60 * worth / minutes).max())
    return float(max(gains))


def choose_designs(
    draws: ArrayLike,
    threshold: float,
    trials: int,
    number: int,
    chosen: Sequence[int] = (),
    near: NDArray[Any] | None = None,
    zone: float = 0.0,
) -> list[int]:
    """Choose up to ``number`` designs besides those ``chosen`` already, one by one, by the expected gain of their trials.

    ``draws`` (draws, designs) are of the rates; ``zone`` as in :func:`value_of_trials`. A design's gain is multiplied by
    the fraction of its variance that the chosen designs do not predict. ``near`` (designs, designs) marks neighbours: if
    it is given, no two neighbours are chosen, and only the gain about the threshold counts, not which design is best.
    Returns the indices of the new designs.
    """
    p = numpy.asarray(draws, dtype=float)
    # If no design has a gain, the designs least predicted by the others come first.
    worth = value_of_trials(p, threshold, trials, zone)
    value = worth.threshold + 1e-9 + (worth.choice if near is None else 0.0)
    indices = list(chosen)
    while len(indices) < min(len(chosen) + number, p.shape[1]):
        score = value * _residual_variance_fraction(p, indices)
        score[indices] = -numpy.inf
        if near is not None:
            score[near[indices].any(axis=0)] = -numpy.inf
            if numpy.isinf(score).all():
                break
        indices.append(int(score.argmax()))
    return indices[len(chosen) :]


def _residual_variance_fraction(draws: NDArray[Any], chosen: Sequence[int]) -> NDArray[Any]:
    """Return the fraction (designs,) of each design's variance that is left after linear regression on the chosen."""
    if not chosen:
        return numpy.ones(draws.shape[1])
    centred = draws - draws.mean(axis=0)
    basis, _ = numpy.linalg.qr(centred[:, list(chosen)])
    rest = centred - basis @ (basis.T @ centred)
    variance = (centred**2).sum(axis=0)
    return numpy.asarray((rest**2).sum(axis=0) / numpy.where(variance > 0, variance, 1.0))


def trials_needed(rates: ArrayLike, half_width: float) -> int:
    """Return how many trials narrow Wilson's 95 % interval to ``half_width`` (0 to 0.5), on average over ``rates``.

    The number is at most MAX_TRIALS. It is found by bisection, because the width falls with the number of trials.
    """
    p = numpy.asarray(rates, dtype=float).ravel()
    return bisect_left(range(MAX_TRIALS), -half_width, lo=1, key=lambda number: -_mean_half_width(p, number))


def trials_to_decide(rates: ArrayLike, threshold: float) -> int:
    """Return how many trials decide on which side of the threshold t a rate p is: the median over ``rates``, draws of p.

    If the fraction that passes equals p, the score test decides (95 %) after n > z² t (1 - t) / (p - t)² trials. The
    number is at most MAX_TRIALS.
    """
    distances = numpy.abs(numpy.asarray(rates, dtype=float) - threshold)
    needed = Z**2 * threshold * (1 - threshold) / numpy.maximum(distances, 1e-9) ** 2
    return min(MAX_TRIALS, int(numpy.median(needed)) + 1)


@dataclass(frozen=True)
class Effort:
    """Further ``cars`` to build and ``trials`` to drive; in the end each car has at least ``each`` trials."""

    cars: int
    trials: int
    each: int

    def work_min(self, car_min: float, trial_min: float) -> float:
        """Return the minutes of work, given those of a car and of a trial."""
        return self.cars * car_min + self.trials * trial_min


def correlation_within_cars(rates: ArrayLike, car_sd: float) -> float:
    """Return the intraclass correlation of trials: the fraction of their variance that lies between cars of a design.

    The log-odds of a design's cars are normal with deviation ``car_sd``; the mean rate of its cars is one of ``rates``.
    """
    # Gauss-Hermite quadrature over the log-odds of a design's cars, which are centred so that their mean rate is p.
    p = numpy.asarray(rates, dtype=float).ravel().clip(1e-6, 1 - 1e-6)
    nodes, weights = numpy.polynomial.hermite_e.hermegauss(40)
    centre = numpy.log(p / (1 - p)) * centre_factor(car_sd)
    cars = 1 / (1 + numpy.exp(-(centre[:, None] + car_sd * nodes)))
    # (rates,): means over the cars of their rate and of its square.
    mean, square = (power @ weights / weights.sum() for power in (cars, cars**2))
    return float((square - mean**2).mean() / (mean * (1 - mean)).mean())


def independent_trials(done: ArrayLike, correlation: float) -> Any:
    """Return the number of independent trials that tell as much as ``done`` (..., cars) trials of each car.

    m cars with n trials each give a design's rate a variance of p (1 - p) (1 + (n - 1) ρ) / (m n), where ρ is the
    ``correlation`` within cars (Kish 1965, design effect).
    """
    number = numpy.asarray(done, dtype=float)
    return (number / (1 + (number - 1) * correlation)).sum(axis=-1)


def least_effort(
    independent: float, correlation: float, car_min: float, trial_min: float, done: Sequence[int] = ()
) -> Effort:
    """Return the cars and trials of least work that tell as much as ``independent`` trials of different cars.

    ``correlation`` is that within cars, below 1. ``done`` are the trials of each car built so far. A new car takes
    ``car_min`` minutes, a trial ``trial_min``. Every possible number of trials per car is compared.
    """
    # (e, 1) for the e possible numbers; built cars are along the second axis.
    trials_per_car = numpy.arange(1, MAX_EACH * math.ceil(independent) + 1)[:, None]
    built = numpy.array(done, dtype=int)[None]
    # Built cars are driven up to that number, too; rounding must not add a car.
    missing = independent - independent_trials(numpy.maximum(trials_per_car, built), correlation)
    cars = numpy.ceil(missing / independent_trials(trials_per_car, correlation) - 1e-9).clip(0).astype(int)
    trials = cars * trials_per_car[:, 0] + (trials_per_car - built).clip(0).sum(axis=1)
    best = int((cars * car_min + trials * trial_min).argmin())
    return Effort(int(cars[best]), int(trials[best]), int(trials_per_car[best, 0]))


def further_effort(
    further: int, correlation: float, car_min: float, trial_min: float, done: Sequence[int] = (), min_total: int = 0
) -> Effort:
    """Return the least work for ``further`` independent trials, at least ``min_total`` in all; see least_effort."""
    independent = max(min_total, independent_trials(done, correlation) + further)
    return least_effort(independent, correlation, car_min, trial_min, done)


def _mean_half_width(rates: NDArray[Any], number: int) -> float:
    """Return the mean half-width, over ``rates``, of Wilson's interval of ``number`` trials that pass at that rate."""
    widths = numpy.sqrt(rates * (1 - rates) / number + (Z / (2 * number)) ** 2) * Z / (1 + Z**2 / number)
    return float(widths.mean())


def informative_environments(passed: ArrayLike, number: int, excluded: Collection[int] = ()) -> list[int]:
    """Choose ``number`` environments that represent all of them, and in which the designs' simulated results differ.

    ``passed`` (designs, environments) are simulated results, NaN without one; environments in ``excluded`` are not
    chosen. Each choice brings the designs' passed fractions nearest to those over all environments. So the chosen
    environments are neither harder nor easier than the others. Of equally good environments the one in which designs
    differ most is chosen. Returns indices, those with the largest differences first.
    """
    passed_table = numpy.asarray(passed, dtype=float)
    complete = ~numpy.isnan(passed_table).any(axis=0)
    available = [index for index in numpy.flatnonzero(complete) if index not in excluded]
    if not available:
        return []
    fractions = passed_table[:, complete].mean(axis=1)
    spread = passed_table.std(axis=0)
    chosen: list[int] = []
    total = numpy.zeros(len(passed_table))
    for size in range(1, min(number, len(available)) + 1):
        candidates = numpy.array([index for index in available if index not in chosen])
        errors = (((total[:, None] + passed_table[:, candidates]) / size - fractions[:, None]) ** 2).sum(axis=0)
        # Differences below a tenth of an environment count as equal.
        order = numpy.lexsort((candidates, -spread[candidates], numpy.round(errors * size**2, 1)))
        chosen.append(int(candidates[order[0]]))
        total = total + passed_table[:, chosen[-1]]
    return sorted(chosen, key=lambda index: (-spread[index], index))


def split_sample_best(passed: ArrayLike) -> tuple[int, int, int]:
    """Return the index of the best design in simulation, and numbers of its passed and of all its runs.

    ``passed`` (designs, environments) is 1 or 0, NaN without a run. The rate of the best of many designs is biased
    upwards in the environments that chose it. So one half of the environments chooses, and only the other half counts.
    """
    table = numpy.asarray(passed, dtype=float)
    choosing, counting = table[:, 0::2], table[:, 1::2]
    counts = (~numpy.isnan(choosing)).sum(axis=1)
    # Half a pass in one added run, so that a design with few runs is rarely the best by chance.
    rates = (numpy.nansum(choosing, axis=1) + 0.5) / (counts + 1)
    # Of equally good designs take the middle one: neighbours that are as good make it a safer choice.
    ties = numpy.flatnonzero(rates >= rates.max() - 1e-12)
    best = int(ties[len(ties) // 2])
    counted = counting[best][~numpy.isnan(counting[best])]
    return best, int(counted.sum()), len(counted)


def expected_loss(draws: ArrayLike) -> tuple[int, float]:
    """Return the design with the highest mean rate, and its expected loss, 0 to 1, against the truly best design.

    ``draws`` (draws, designs) are joint draws of the rates. The loss of a draw is the best rate minus the design's.
    """
    p = numpy.asarray(draws, dtype=float)
    best = int(numpy.argmax(p.mean(axis=0)))
    return best, float((p.max(axis=1) - p[:, best]).mean())
