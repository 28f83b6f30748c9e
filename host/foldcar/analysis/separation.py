"""Which values of the environment separate runs that passed from runs that failed.

Of two runs of one design, one passed and one failed, with what probability does the passed one have the greater value?
Twice that less 1 is Somers' D (1962, doi:10.2307/2090408), -1 to 1: 0 if the value tells nothing, and 2 AUC - 1 where
there is one design. Designs that always pass or always fail say nothing. Its variance is that over environments, which
all designs share: the jackknife of a U-statistic (Arvesen 1969, doi:10.1214/aoms/1177697287).
"""

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

# Fewer environments say nothing of their values.
LEAST_ENVIRONMENTS = 8
# Of more environments so many are compared, evenly chosen: all pairs are counted.
MOST_ENVIRONMENTS = 2000


@dataclass(frozen=True)
class Separation:
    """Somers' ``difference``, -1 to 1: above 0 runs pass at greater values. Intervals of all columns hold together.

    ``share`` is its magnitude, 0 to 1, with its interval ``low`` to ``high``; a value tells something if low is above 0.
    """

    column: int
    difference: float
    low: float
    high: float

    @property
    def share(self) -> float:
        """How well the value separates, 0 to 1."""
        return abs(self.difference)


def separations(values: ArrayLike, design: ArrayLike, environment: ArrayLike, passed: ArrayLike) -> list[Separation]:
    """How well each column of ``values`` (environments, columns; NaN where there is none) separates, the best first.

    Runs (n,): index of the design, of the environment, 1 if passed. A column is left out where fewer than
    LEAST_ENVIRONMENTS have it, or where nothing passed or nothing failed.
    """
    from scipy.special import stdtrit

    table = numpy.asarray(values, dtype=float)
    at, where, ended = numpy.asarray(design), numpy.asarray(environment), numpy.asarray(passed, dtype=bool)
    if not len(at) or not table.size:
        return []
    chosen = numpy.unique(where)
    if len(chosen) > MOST_ENVIRONMENTS:
        chosen = chosen[numpy.linspace(0, len(chosen) - 1, MOST_ENVIRONMENTS).round().astype(int)]
    kept = numpy.isin(where, chosen)
    where = numpy.searchsorted(chosen, where[kept])
    _, at = numpy.unique(at[kept], return_inverse=True)
    table, ended = table[chosen], ended[kept]
    good, bad = (numpy.zeros((at.max() + 1, len(chosen)), dtype=numpy.float32) for _ in range(2))
    good[at[ended], where[ended]], bad[at[~ended], where[~ended]] = 1, 1
    # Of how many designs the run passed in one environment (rows) and failed in the other (columns).
    pairs = good.T @ bad
    found = []
    # Bonferroni: the intervals hold together.
    tail = 0.025 / table.shape[1]
    for column, some in enumerate(table.T):
        there = numpy.flatnonzero(~numpy.isnan(some))
        if len(there) < LEAST_ENVIRONMENTS or numpy.ptp(some[there]) == 0:
            continue
        here, among = some[there], pairs[numpy.ix_(there, there)]
        total = float(among.sum(dtype=float))
        if not total:
            continue
        signed = among * numpy.sign(here[:, None] - here[None, :])
        difference = float(signed.sum(dtype=float)) / total
        weight = _margins(signed) - difference * _margins(among)
        number = len(there)
        deviation = numpy.sqrt((weight**2).sum() * number / (number - 1)) / total
        reach = float(stdtrit(number - 1, 1 - tail)) * deviation
        # The interval of the magnitude, from that of the difference.
        low, high = max(0.0, abs(difference) - reach), min(1.0, abs(difference) + reach)
        found.append(Separation(column, difference, low, high))
    return sorted(found, key=lambda one: -one.share)


def _margins(table: NDArray[Any]) -> NDArray[Any]:
    """What each environment has part in: its row and its column."""
    return numpy.asarray(table.sum(axis=0, dtype=float) + table.sum(axis=1, dtype=float))


@dataclass(frozen=True)
class Bin:
    """Runs at values from ``first`` to ``last``: how many, and how many of them passed."""

    first: float
    last: float
    runs: int
    passed: int


def binned(values: ArrayLike, environment: ArrayLike, passed: ArrayLike, most: int = 8) -> list[Bin]:
    """Runs by the value (environments,) of their environment, in at most ``most`` bins of as many environments each."""
    some, where = numpy.asarray(values, dtype=float), numpy.asarray(environment)
    ended = numpy.asarray(passed, dtype=float)
    known = some[~numpy.isnan(some)]
    kinds = numpy.unique(known)
    edges = kinds if len(kinds) <= most else numpy.unique(numpy.quantile(known, numpy.linspace(0, 1, most + 1)[:-1]))
    place = numpy.searchsorted(edges, some, side="right") - 1
    found = []
    for at in range(len(edges)):
        inside = (place == at) & ~numpy.isnan(some)
        runs = inside[where]
        if runs.any():
            held = some[inside]
            found.append(Bin(float(held.min()), float(held.max()), int(runs.sum()), int(ended[runs].sum())))
    return found
