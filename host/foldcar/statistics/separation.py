"""Measure which values of the environment separate runs that passed from runs that failed.

Take two runs of one design, of which one passed and one failed. Let q be the probability that the passed run has the
greater value. Somers' D (1962, doi:10.2307/2090408) is 2 q - 1, from -1 to 1. It is 0 if the value is uninformative; for
a single design it equals 2 AUC - 1. Designs that always pass or always fail do not count.

The null distribution of D comes from permuting the environments, with all columns together, because all designs share
them. The critical value is r = c standard deviations of the permutations. c is the 95 % quantile of the largest
standardised deviation of any column, so all intervals hold together (Westfall and Young's max T, 1993). The interval is
tanh(artanh D ± artanh r): like a correlation's, it is narrower far from 0 (Fisher's z).

Let S_ij be the sign of the difference of two environments' values. Let A_ij be the number of designs that passed in i and
failed in j, minus the reverse. D is the sum of A_ij S_ij over all i < j, divided by the number of pairs. If each design
was run in every environment, A_ij = w_i - w_j, where w_i designs passed in i. Then the sum is that of w_i s_i, with s_i
the sum of S_ij over j, so all permutations are one product of matrices. Otherwise w is fitted by least squares. The
residual of A adds a third of its sum of squares to the variance of the sum.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy
from numpy.typing import ArrayLike, NDArray

# With fewer environments no column is measured.
MIN_ENVIRONMENTS = 8
# Largest number of environments that are compared, evenly chosen, because the work grows with the number of pairs.
MAX_ENVIRONMENTS = 2000
PERMUTATIONS = 999
# Somers' D is limited to this, because artanh of 1 is infinite.
MAX_SHARE = 1 - 1e-9
# Sums are not divided by a smaller standard deviation.
MIN_DEVIATION = 1e-12


@dataclass(frozen=True)
class Separation:
    """How well the values of a column separate passed from failed runs.

    ``difference`` is Somers' D, -1 to 1; above 0, runs pass at greater values. ``share`` is its magnitude, 0 to 1, with
    the 95 % interval ``low`` to ``high``. A column is informative if low is above 0. The intervals of all columns hold
    together.
    """

    column: int
    difference: float
    low: float
    high: float

    @property
    def share(self) -> float:
        """How well the value separates passed from failed runs, 0 to 1."""
        return abs(self.difference)


def separations(values: ArrayLike, design: ArrayLike, environment: ArrayLike, passed: ArrayLike) -> list[Separation]:
    """Return how well each column of ``values`` separates passed from failed runs, the best first.

    ``values`` (environments, columns) are NaN where unknown. ``design``, ``environment`` and ``passed`` (runs,) are each
    run's index of the design, index of the environment, and 1 if it passed, else 0. A column is left out if fewer than
    MIN_ENVIRONMENTS have a value, or if no design both passed and failed. The file's head has the formulas.
    """
    table = numpy.asarray(values, dtype=float)
    design_index, environment_index = numpy.asarray(design), numpy.asarray(environment)
    if not len(design_index) or not table.size:
        return []
    environments = numpy.unique(environment_index)
    if len(environments) > MAX_ENVIRONMENTS:
        evenly_spaced = numpy.linspace(0, len(environments) - 1, MAX_ENVIRONMENTS).round().astype(int)
        environments = environments[evenly_spaced]
    is_used = numpy.isin(environment_index, environments)
    pairs = _passed_failed_pairs(
        design_index[is_used],
        numpy.searchsorted(environments, environment_index[is_used]),
        numpy.asarray(passed, dtype=bool)[is_used],
        len(environments),
    )
    excess = pairs - pairs.T
    compared = []
    for column, column_values in enumerate(table[environments].T):
        compared_column = _compare_column(column, column_values, pairs, excess)
        if compared_column is not None:
            compared.append(compared_column)
    if not compared:
        return []
    scores = numpy.array([compared_column.scores for compared_column in compared]).T
    numbers_of_pairs = numpy.array([compared_column.pairs for compared_column in compared])
    critical_values = _critical_values(scores, excess) / numbers_of_pairs
    separations = []
    for compared_column, critical_value in zip(compared, critical_values.tolist(), strict=True):
        difference = compared_column.difference
        middle, half_width = numpy.arctanh(numpy.minimum([abs(difference), critical_value], MAX_SHARE))
        # The interval of the magnitude, from that of the difference.
        low = max(0.0, float(numpy.tanh(middle - half_width)))
        high = float(numpy.tanh(middle + half_width))
        separations.append(Separation(compared_column.column, difference, low, high))
    return sorted(separations, key=lambda separation: -separation.share)


def _passed_failed_pairs(
    design_index: NDArray[Any], environment_index: NDArray[Any], has_passed: NDArray[Any], environments: int
) -> NDArray[Any]:
    """Count, for each pair of environments, the designs that passed in the first and failed in the second.

    ``design_index``, ``environment_index`` and ``has_passed`` have an entry for each run. The result has a row for each
    first environment and a column for each second one: (environments, environments).
    """
    # The designs that occur are numbered again from 0.
    _, design_index = numpy.unique(design_index, return_inverse=True)
    shape = design_index.max() + 1, environments
    # Matrices (designs, environments) with 1 where a design passed, and with 1 where it failed.
    passed_in = numpy.zeros(shape, numpy.float32)
    failed_in = numpy.zeros(shape, numpy.float32)
    passed_in[design_index[has_passed], environment_index[has_passed]] = 1
    failed_in[design_index[~has_passed], environment_index[~has_passed]] = 1
    return numpy.asarray(passed_in.T @ failed_in)


class _ComparedColumn(NamedTuple):
    """A column of values: its index, Somers' D, the number of pairs of runs, and s of the file's head (environments,)."""

    column: int
    difference: float
    pairs: float
    scores: NDArray[Any]


def _compare_column(
    column: int, values: NDArray[Any], pairs: NDArray[Any], excess: NDArray[Any]
) -> _ComparedColumn | None:
    """Return Somers' D of a column, which says how well its values separate passed from failed runs.

    ``values`` (environments,) are the values of the column, NaN if unknown. ``pairs`` (environments, environments) is the
    result of :func:`_passed_failed_pairs`, and ``excess`` is ``pairs`` minus its transpose. Returns None if the column
    cannot be compared: it has too few values, all its values are equal, or there is no pair.
    """
    is_known = ~numpy.isnan(values)
    known_values = values[is_known]
    if len(known_values) < MIN_ENVIRONMENTS or numpy.ptp(known_values) == 0:
        return None
    number_of_pairs = float(is_known @ pairs @ is_known)
    if not number_of_pairs:
        return None
    signs = _signs_of_differences(values)
    # The matrices have each pair of environments twice.
    sum_over_pairs = float((excess * signs).sum(dtype=float)) / 2
    difference = sum_over_pairs / number_of_pairs
    return _ComparedColumn(column, difference, number_of_pairs, signs.sum(axis=1, dtype=float))


def _signs_of_differences(values: NDArray[Any]) -> NDArray[Any]:
    """Return the sign of the difference of each pair of ``values`` (n,): a matrix (n, n), 0 where a value is NaN."""
    _, ranks = numpy.unique(values, return_inverse=True)
    ranks = ranks.astype(numpy.float32)
    signs = numpy.sign(ranks[:, None] - ranks[None, :])
    is_unknown = numpy.isnan(values)
    signs[is_unknown] = 0
    signs[:, is_unknown] = 0
    return numpy.asarray(signs)


def _critical_values(scores: NDArray[Any], excess: NDArray[Any]) -> NDArray[Any]:
    """Return how large the sum of each column over all pairs of environments may be by chance (columns,).

    The sum is the numerator of Somers' D: the sum of A_ij S_ij over i < j, in the symbols of the file's head. ``excess``
    (environments, environments) is A, and ``scores`` (environments, columns) are s, the sums of S_ij over j. If no column
    had anything to do with success, a sum of any column would exceed its critical value with a probability of 5 %.
    """
    # The least-squares fit of A_ij = w_i - w_j, and its residual.
    weights = excess.mean(axis=1, dtype=float)
    residual = excess - (weights[:, None] - weights[None, :])
    # The sums of each column if the environments are permuted at random: (permutations, columns).
    random = numpy.random.default_rng(0)
    orders = random.permuted(numpy.tile(numpy.arange(len(weights)), (PERMUTATIONS, 1)), axis=1)
    permuted_sums = weights[orders] @ scores
    deviations = numpy.sqrt((permuted_sums**2).mean(axis=0))
    # The sums in standard deviations, and the largest one of all columns in each permutation.
    standardised = numpy.abs(permuted_sums) / numpy.maximum(deviations, MIN_DEVIATION)
    max_standardised = standardised.max(axis=1)
    quantile = numpy.quantile(max_standardised, 0.95, method="higher")
    # The residual adds a third of its sum of squares over i < j; the matrix has each of these pairs twice.
    residual_variance = (residual**2).sum(dtype=float) / 2 / 3
    return numpy.asarray(quantile * numpy.sqrt(deviations**2 + residual_variance))


@dataclass(frozen=True)
class Bin:
    """Runs at values from ``first`` to ``last``: their number, and the number that passed."""

    first: float
    last: float
    runs: int
    passed: int


def binned(values: ArrayLike, environment: ArrayLike, passed: ArrayLike, max_bins: int = 8) -> list[Bin]:
    """Divide the environments by a value into bins, and count the runs in each bin.

    There are at most ``max_bins`` bins, with about equally many environments in each. ``values`` (environments,) are the
    values, NaN if unknown. ``environment`` (runs,) is the index of each run's environment, and ``passed`` (runs,) is 1 if
    the run passed, else 0.
    """
    value, environment_index = numpy.asarray(values, dtype=float), numpy.asarray(environment)
    has_passed = numpy.asarray(passed, dtype=float)
    is_known = ~numpy.isnan(value)
    # The lower edges of the bins. If there are few values, each value has a bin of its own; otherwise they are quantiles.
    lower_edges = numpy.unique(value[is_known])
    if len(lower_edges) > max_bins:
        fractions = numpy.linspace(0, 1, max_bins + 1)[:-1]
        lower_edges = numpy.unique(numpy.quantile(value[is_known], fractions))
    bin_of_environment = numpy.searchsorted(lower_edges, value, side="right") - 1
    bins = []
    for bin_index in range(len(lower_edges)):
        is_in_bin = (bin_of_environment == bin_index) & is_known
        is_run_in_bin = is_in_bin[environment_index]
        if is_run_in_bin.any():
            bin_values = value[is_in_bin]
            bins.append(
                Bin(
                    first=float(bin_values.min()),
                    last=float(bin_values.max()),
                    runs=int(is_run_in_bin.sum()),
                    passed=int(has_passed[is_run_in_bin].sum()),
                )
            )
    return bins
