"""Measure which values of the environment separate runs that passed from runs that failed.

Of two runs of one design, one passed and one failed, with what probability does the passed one have the greater value?
Twice that less 1 is Somers' D (1962, doi:10.2307/2090408), -1 to 1: 0 if the value tells nothing, and 2 AUC - 1 where
there is one design. Designs that always pass or always fail say nothing.

All designs share the environments, so chance is that of which environment has which values. It is measured by permuting
the environments' values, those of all columns together. D reaches r = c standard deviations of its permutations with
c the 95 % quantile of the largest such deviation of any column, so that all intervals hold together (Westfall and Young's
max T, 1993). The interval is tanh(artanh D ± artanh r): like a correlation's, it is narrower far from 0 (Fisher's z).

With S_ij the sign of the difference of two environments' values and A_ij how many more designs passed in i and failed in
j than the other way round, D is the sum of A_ij S_ij over all i < j, divided by the number of pairs. Where each design
was run in every environment, A_ij = w_i - w_j with w_i the designs that passed in i, and the sum is that of w_i s_i, with
s_i the sum of S_ij over j: permutations cost no more than a product of matrices. Elsewhere w is fitted by least squares,
and what it leaves of A adds its variance, a third of its sum of squares, to that of the sum.
"""

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

# Fewer environments say nothing of their values.
MIN_ENVIRONMENTS = 8
# Of more environments so many are compared, evenly chosen: all pairs are counted.
MAX_ENVIRONMENTS = 2000
PERMUTATIONS = 999
# Artanh of 1 is infinite.
MAX_SHARE = 1 - 1e-9


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
    """Return how well each column of ``values`` (environments, columns; NaN where unknown) separates, the best first.

    Runs (n,): index of the design, of the environment, 1 if passed. A column is left out where fewer than
    MIN_ENVIRONMENTS have it, or where nothing passed or nothing failed.
    """
    table = numpy.asarray(values, dtype=float)
    at, where, ended = numpy.asarray(design), numpy.asarray(environment), numpy.asarray(passed, dtype=bool)
    if not len(at) or not table.size:
        return []
    chosen = numpy.unique(where)
    if len(chosen) > MAX_ENVIRONMENTS:
        chosen = chosen[numpy.linspace(0, len(chosen) - 1, MAX_ENVIRONMENTS).round().astype(int)]
    kept = numpy.isin(where, chosen)
    where = numpy.searchsorted(chosen, where[kept])
    _, at = numpy.unique(at[kept], return_inverse=True)
    table, ended = table[chosen], ended[kept]
    good, bad = (numpy.zeros((at.max() + 1, len(chosen)), dtype=numpy.float32) for _ in range(2))
    good[at[ended], where[ended]], bad[at[~ended], where[~ended]] = 1, 1
    # Of how many designs the run passed in one environment (rows) and failed in the other (columns).
    pairs = good.T @ bad
    more = pairs - pairs.T
    columns, differences, totals, scores = [], [], [], []
    for column, some in enumerate(table.T):
        known = ~numpy.isnan(some)
        total = float(known @ pairs @ known)
        if known.sum() < MIN_ENVIRONMENTS or numpy.ptp(some[known]) == 0 or not total:
            continue
        ranks = numpy.unique(some, return_inverse=True)[1].astype(numpy.float32)
        signs = numpy.sign(ranks[:, None] - ranks[None, :])
        signs[~known], signs[:, ~known] = 0, 0
        columns.append(column)
        totals.append(total)
        differences.append(float((more * signs).sum(dtype=float)) / 2 / total)
        scores.append(signs.sum(axis=1, dtype=float))
    if not columns:
        return []
    separations = []
    reaches = _reaches(numpy.array(scores).T, more) / numpy.array(totals)
    for column, difference, reach in zip(columns, differences, reaches.tolist(), strict=True):
        middle, half = numpy.arctanh(numpy.minimum([abs(difference), reach], MAX_SHARE))
        # The interval of the magnitude, from that of the difference.
        low, high = max(0.0, float(numpy.tanh(middle - half))), float(numpy.tanh(middle + half))
        separations.append(Separation(column, difference, low, high))
    return sorted(separations, key=lambda separation: -separation.share)


def _reaches(scores: NDArray[Any], more: NDArray[Any]) -> NDArray[Any]:
    """Return how far chance takes each column's sum of A_ij S_ij: ``scores`` (environments, columns), A."""
    weights = more.mean(axis=1, dtype=float)
    residual = (more - weights[:, None] + weights[None, :]) / numpy.sqrt(2)
    random = numpy.random.default_rng(0)
    orders = random.permuted(numpy.tile(numpy.arange(len(weights)), (PERMUTATIONS, 1)), axis=1)
    sums = weights[orders] @ scores
    deviation = numpy.sqrt((sums**2).mean(axis=0))
    quantile = numpy.quantile((numpy.abs(sums) / numpy.maximum(deviation, 1e-12)).max(axis=1), 0.95, method="higher")
    return numpy.asarray(quantile * numpy.sqrt(deviation**2 + (residual**2).sum(dtype=float) / 3))


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
    result = []
    for at in range(len(edges)):
        inside = (place == at) & ~numpy.isnan(some)
        runs = inside[where]
        if runs.any():
            held = some[inside]
            result.append(Bin(float(held.min()), float(held.max()), int(runs.sum()), int(ended[runs].sum())))
    return result
