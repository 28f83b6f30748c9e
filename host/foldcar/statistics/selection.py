"""Which designs to build first, which to try next, how many trials they need, and in which environments.

First designs mark the feasible region of simulation: those that reach a threshold of success, for one parameter or for
several. An edge is a feasible design beside one that is not, the middle is the feasible design farthest from all that are
not and from the ends of the range. Later ones go by draws of the true rates (:mod:`foldcar.statistics.pooled_bias`).
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
MAX_TRIALS = 10_000
# The most trials of one car that may stand for a trial of many.
MAX_EACH = 10
MIN_DESIGNS, MAX_WEIGHED = 20, 240_000
# Numbers of independent trials of one design whose worth is weighed.
BATCHES = (10, 40)
# The normal quantile of 0.975.
Z = 1.959963984540054


@dataclass(frozen=True)
class Placed:
    """A design, by its index, and its place in the feasible region: one of MIDDLE, LOWER_EDGE, … of this module."""

    index: int
    place: str


def first_designs(parameters: ArrayLike, rates: ArrayLike, uncertainty: ArrayLike, threshold: float) -> list[Placed]:
    """The designs to build before there are trials, the most useful first.

    ``parameters`` (designs, k), ``rates`` (designs,) of simulation, their ``uncertainty`` (designs,; the larger, the less
    is known of the border there), ``threshold``: all rates 0 to 1. In order: the middle, the edge whose border is less
    known, designs outside on both sides, the other edge. Without a feasible design: the best one. Without a border in the
    range: the middle and the range's ends.
    """
    x, p, doubt = (numpy.asarray(values, dtype=float) for values in (parameters, rates, uncertainty))
    feasible, unit = p >= threshold, unit_range(x)
    if not feasible.any():
        return [Placed(int(numpy.argmax(p)), BEST)]
    # The largest distance of neighbouring values of each parameter.
    step = numpy.array([numpy.diff(numpy.unique(column)).max(initial=0.0) for column in unit.T])
    middle = _middle(unit, feasible, step)
    if feasible.all():
        sums = unit.sum(axis=1)
        ends = dict.fromkeys(index for index in (int(sums.argmin()), int(sums.argmax())) if index != middle)
        return [Placed(middle, MIDDLE), *(Placed(index, END) for index in ends)]
    edges = _opposite(_edges(unit, feasible, step), doubt, unit, middle)
    outside = _opposite(numpy.flatnonzero(~feasible), -numpy.abs(p - threshold / 2), unit, middle, edges[:1])
    varied = numpy.flatnonzero(numpy.ptp(x, axis=0) > 0)

    def place(index: int, low: str, high: str, either: str) -> Placed:
        """With its side, where one parameter varies."""
        if len(varied) != 1:
            return Placed(index, either)
        return Placed(index, low if x[index, varied[0]] < x[middle, varied[0]] else high)

    at_edge = [place(index, LOWER_EDGE, UPPER_EDGE, EDGE) for index in edges]
    beyond = [place(index, BELOW, ABOVE, OUTSIDE) for index in outside]
    found: dict[int, Placed] = {}
    for one in (Placed(middle, MIDDLE), *at_edge[:1], *beyond, *at_edge[1:]):
        found.setdefault(one.index, one)
    return list(found.values())


def _middle(unit: NDArray[Any], feasible: NDArray[Any], step: NDArray[Any]) -> int:
    ends = numpy.minimum(unit, 1 - unit) + step
    # A parameter that does not vary has no ends.
    depth = numpy.where(numpy.ptp(unit, axis=0) > 0, ends, numpy.inf).min(axis=1, initial=numpy.inf)
    depth = numpy.minimum(depth, _distances(unit, unit[~feasible]).min(axis=1, initial=numpy.inf))
    depth = numpy.where(feasible, depth, -numpy.inf)
    # Of several equally deep ones the central one.
    best = numpy.flatnonzero(depth >= depth.max() - 1e-9)
    return int(best[len(best) // 2])


def _edges(unit: NDArray[Any], feasible: NDArray[Any], step: NDArray[Any]) -> NDArray[Any]:
    """The feasible designs with an infeasible neighbour: one step away along one parameter."""
    inside, others = numpy.flatnonzero(feasible), unit[~feasible]
    apart = numpy.abs(unit[inside][:, None] - others[None, :])
    near = ((apart <= 1.01 * step).all(axis=2) & ((apart > 1e-9).sum(axis=2) == 1)).any(axis=1)
    # On a grid with gaps no neighbour may be there: the feasible design nearest to an infeasible one.
    return inside[near] if near.any() else inside[[int(_distances(unit[inside], others).min(axis=1).argmin())]]


def _distances(one: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
    return numpy.asarray(numpy.sqrt(((one[:, None] - other[None, :]) ** 2).sum(axis=2)))


def _opposite(
    indices: NDArray[Any], score: NDArray[Any], unit: NDArray[Any], middle: int, apart_from: Sequence[int] = ()
) -> list[int]:
    """Two of the highest score, the first opposite of ``apart_from`` as seen from the middle, the second of the first."""
    chosen: list[int] = []
    before = list(apart_from)
    for _ in range(min(2, len(indices))):
        left = numpy.array([index for index in indices if index not in chosen])
        if before:
            opposite = (unit[left] - unit[middle]) @ (unit[before[-1]] - unit[middle]) < 0
            left = left[opposite] if opposite.any() else left
        chosen.append(int(left[score[left].argmax()]))
        before = list(chosen)
    return chosen


@dataclass(frozen=True)
class Value:
    """What more trials of each design (designs,) are worth on average, 0 to 1.

    ``choice``: by how much more the design that is best then would pass than the one that is best now (the knowledge
    gradient, Frazier, Powell and Dayanik 2008). ``threshold``: by how much smaller the share of designs would be that are
    put on the wrong side of the threshold.
    """

    choice: NDArray[Any]
    threshold: NDArray[Any]


def value_of_trials(draws: ArrayLike, threshold: float, trials: int, zone: float = 0.0) -> Value:
    """The value of ``trials`` trials of each design, over how many of them would pass; ``draws`` (draws, designs).

    Within ``zone`` of the threshold (0 to 1) no side is wrong.
    """
    from scipy.special import gammaln

    p = numpy.asarray(draws, dtype=float)
    above, below = (p >= threshold + zone).astype(float), (p < threshold - zone).astype(float)
    now = numpy.max(p.mean(axis=0))
    wrong_now = numpy.minimum(above.mean(axis=0), below.mean(axis=0)).mean()
    choice, right = numpy.zeros(p.shape[1]), numpy.zeros(p.shape[1])
    sides, rates = numpy.hstack([p, above, below]), p.clip(1e-12, 1 - 1e-12)
    passed = numpy.arange(trials + 1)[:, None]
    ways = gammaln(trials + 1) - gammaln(passed + 1) - gammaln(trials - passed + 1)
    for design, (log_pass, log_fail) in enumerate(zip(numpy.log(rates).T, numpy.log1p(-rates).T, strict=True)):
        # Rows: outcomes of the trials; columns: draws, by their weight once the outcome is known.
        chance = numpy.exp(ways + passed * log_pass + (trials - passed) * log_fail) / len(p)
        then = (chance @ sides).reshape(trials + 1, 3, -1)
        choice[design] = then[:, 0].max(axis=1).sum() - now
        right[design] = wrong_now - numpy.minimum(then[:, 1], then[:, 2]).sum(axis=0).mean()
    # Rounding may leave a hair below 0.
    return Value(choice.clip(0), right.clip(0))


def gain_per_hour(draws: ArrayLike, threshold: float, zone: float, work_min: ArrayLike) -> float:
    """What an hour of work wins at most, 0 to 1: the :class:`Value` of one design's trials by their time.

    ``work_min`` (BATCHES, designs): the minutes that so many further independent trials of each design take, cars that
    are to be built for them among these (:func:`least_effort`). The best of several numbers of trials: one trial may be
    worth nothing where many are (Frazier and Powell 2010, doi:10.1287/deca.1100.0188). Of a small family a design is a
    share of 1/MIN_DESIGNS.
    """
    p, found = numpy.asarray(draws, dtype=float), []
    number = p.shape[1]
    for trials, minutes in zip(BATCHES, numpy.asarray(work_min), strict=True):
        # Of many designs some draws are enough.
        value = value_of_trials(p[:: max(1, p.size // MAX_WEIGHED)], threshold, trials, zone)
        worth = value.choice + value.threshold * number / max(number, MIN_DESIGNS)
        found.append((60 * worth / minutes).max())
    return float(max(found))


def choose(
    draws: ArrayLike,
    threshold: float,
    trials: int,
    number: int,
    chosen: Sequence[int] = (),
    near: NDArray[Any] | None = None,
    zone: float = 0.0,
) -> list[int]:
    """Up to ``number`` more designs, first those whose trials are worth most beside those of the ``chosen`` ones.

    What two tell alike counts once: a design whose rate goes with a chosen one's counts by the rest of its variance. With
    ``near`` (designs, designs), which says what neighbours are, none is a neighbour of another, and only the threshold
    counts, not which design is best.
    """
    p = numpy.asarray(draws, dtype=float)
    # Where nothing is worth a trial the least known designs come first.
    worth = value_of_trials(p, threshold, trials, zone)
    value = worth.threshold + 1e-9 + (worth.choice if near is None else 0.0)
    found = list(chosen)
    while len(found) < min(len(chosen) + number, p.shape[1]):
        left = value * _unexplained(p, found)
        left[found] = -numpy.inf
        if near is not None:
            left[near[found].any(axis=0)] = -numpy.inf
            if numpy.isinf(left).all():
                break
        found.append(int(left.argmax()))
    return found[len(chosen) :]


def _unexplained(draws: NDArray[Any], chosen: Sequence[int]) -> NDArray[Any]:
    """The share of each design's variance (designs,) that a linear regression on the chosen designs leaves."""
    if not chosen:
        return numpy.ones(draws.shape[1])
    centred = draws - draws.mean(axis=0)
    basis, _ = numpy.linalg.qr(centred[:, list(chosen)])
    rest = centred - basis @ (basis.T @ centred)
    variance = (centred**2).sum(axis=0)
    return numpy.asarray((rest**2).sum(axis=0) / numpy.where(variance > 0, variance, 1.0))


def trials_needed(rates: ArrayLike, half_width: float) -> int:
    """How many trials make Wilson's 95 % interval as narrow as ``half_width`` (0 to 0.5), on average over ``rates``.

    At most MAX_TRIALS.
    """
    p = numpy.asarray(rates, dtype=float).ravel()
    return bisect_left(range(MAX_TRIALS), -half_width, lo=1, key=lambda number: -_mean_half_width(p, number))


def trials_to_tell(rates: ArrayLike, threshold: float) -> int:
    """How many trials tell, as likely as not, on which side of the threshold a rate is: the median over ``rates``.

    The score test tells (95 %) if the share p of n trials is so far off that n > z² t (1 - t) / (p - t)². At most
    MAX_TRIALS.
    """
    apart = numpy.abs(numpy.asarray(rates, dtype=float) - threshold)
    needed = Z**2 * threshold * (1 - threshold) / numpy.maximum(apart, 1e-9) ** 2
    return min(MAX_TRIALS, int(numpy.median(needed)) + 1)


@dataclass(frozen=True)
class Effort:
    """``cars`` to build and ``trials`` to drive from now on; each car has ``each`` in the end, or more already."""

    cars: int
    trials: int
    each: int

    def work_min(self, car_min: float, trial_min: float) -> float:
        """How many minutes that takes, by those of a car and of a trial."""
        return self.cars * car_min + self.trials * trial_min


def correlation_within_cars(rates: ArrayLike, car_sd: float) -> float:
    """The correlation of two trials of one car: the part of a trial's variance that lies between cars of a design.

    A car passes with log-odds that are normal over cars, of deviation ``car_sd``; a design's rate, one of ``rates``, is
    the mean of its cars'. By quadrature.
    """
    p = numpy.asarray(rates, dtype=float).ravel().clip(1e-6, 1 - 1e-6)
    nodes, weights = numpy.polynomial.hermite_e.hermegauss(40)
    centre = numpy.log(p / (1 - p)) * centre_factor(car_sd)
    cars = 1 / (1 + numpy.exp(-(centre[:, None] + car_sd * nodes)))
    mean, square = (power @ weights / weights.sum() for power in (cars, cars**2))
    return float((square - mean**2).mean() / (mean * (1 - mean)).mean())


def independent_trials(done: ArrayLike, correlation: float) -> Any:
    """As how many independent trials those of each car (..., cars) count together, by the ``correlation`` within cars.

    m cars with n trials each give a design's rate a variance of p (1 - p) (1 + (n - 1) ρ) / (m n) (Kish 1965, design
    effect).
    """
    number = numpy.asarray(done, dtype=float)
    return (number / (1 + (number - 1) * correlation)).sum(axis=-1)


def least_effort(
    independent: float, correlation: float, car_min: float, trial_min: float, done: Sequence[int] = ()
) -> Effort:
    """The quickest way to know a design's rate as well as from so many ``independent`` trials, each of another car.

    ``correlation`` is that within cars, below 1, ``done`` trials of each car that is built; a further one takes
    ``car_min`` minutes, a trial ``trial_min``.
    """
    each = numpy.arange(1, MAX_EACH * math.ceil(independent) + 1)[:, None]
    built = numpy.array(done, dtype=int)[None]
    left = independent - independent_trials(numpy.maximum(each, built), correlation)
    cars = numpy.ceil(left / independent_trials(each, correlation) - 1e-9).clip(0).astype(int)
    trials = cars * each[:, 0] + (each - built).clip(0).sum(axis=1)
    best = int((cars * car_min + trials * trial_min).argmin())
    return Effort(int(cars[best]), int(trials[best]), int(each[best, 0]))


def further_effort(
    further: int, correlation: float, car_min: float, trial_min: float, done: Sequence[int] = (), least: int = 0
) -> Effort:
    """The quickest way to so many ``further`` independent trials, or to ``least`` in all; else as least_effort."""
    wanted = max(least, independent_trials(done, correlation) + further)
    return least_effort(wanted, correlation, car_min, trial_min, done)


def _mean_half_width(rates: NDArray[Any], number: int) -> float:
    """The mean over rates of the half-width of Wilson's interval when a share of the rate has passed."""
    widths = numpy.sqrt(rates * (1 - rates) / number + (Z / (2 * number)) ** 2) * Z / (1 + Z**2 / number)
    return float(widths.mean())


def telling_environments(passed: ArrayLike, number: int, met: Collection[int] = ()) -> list[int]:
    """Environments that represent all, and in which simulation tells the designs apart as often as may be.

    ``passed`` (designs, environments): simulation's results, NaN where there is none; ``met`` are not chosen again. Each
    choice brings the designs' shares of passed runs nearest to those of all environments; of equally good ones the one in
    which the designs differ most. So trials in them are not of harder or easier environments than the others.
    Deterministic. The telling ones stand first.
    """
    table = numpy.asarray(passed, dtype=float)
    known = ~numpy.isnan(table).any(axis=0)
    free = [index for index in numpy.flatnonzero(known) if index not in met]
    if not free:
        return []
    shares = table[:, known].mean(axis=1)
    spread = table.std(axis=0)
    chosen: list[int] = []
    total = numpy.zeros(len(table))
    for size in range(1, min(number, len(free)) + 1):
        left = numpy.array([index for index in free if index not in chosen])
        off = (((total[:, None] + table[:, left]) / size - shares[:, None]) ** 2).sum(axis=0)
        # Differences below a tenth of an environment count as equal.
        order = numpy.lexsort((left, -spread[left], numpy.round(off * size**2, 1)))
        chosen.append(int(left[order[0]]))
        total = total + table[:, chosen[-1]]
    return sorted(chosen, key=lambda index: (-spread[index], index))


def honest_best(passed: ArrayLike) -> tuple[int, int, int]:
    """The best design in simulation, and how many of how many runs it passed in environments that did not choose it.

    ``passed`` (designs, environments), NaN where there is no run. Every second environment chooses, the others count: the
    rate of the best of many in the environments that chose it is too high.
    """
    table = numpy.asarray(passed, dtype=float)
    choosing, counting = table[:, 0::2], table[:, 1::2]
    known = (~numpy.isnan(choosing)).sum(axis=1)
    shares = (numpy.nansum(choosing, axis=1) + 0.5) / (known + 1)
    # Of equally good ones the middle one: neighbours that are as good make it a safer choice.
    ties = numpy.flatnonzero(shares >= shares.max() - 1e-12)
    best = int(ties[len(ties) // 2])
    counted = counting[best][~numpy.isnan(counting[best])]
    return best, int(counted.sum()), len(counted)


def expected_loss(draws: ArrayLike) -> tuple[int, float]:
    """The design of the highest mean rate, and by how much the truly best one passes more often, 0 to 1, on average."""
    p = numpy.asarray(draws, dtype=float)
    best = int(numpy.argmax(p.mean(axis=0)))
    return best, float((p.max(axis=1) - p[:, best]).mean())
