"""How a success rate settled as environments were added, and whether more of them would change the picture."""

from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.intervals import check_confidence, check_counts, jeffreys_interval
from foldcar.errors import FoldcarError

MOST_RUNS = 10_000_000


@dataclass(frozen=True)
class Convergence:
    """The rate and its Jeffreys interval, 0 to 1, after each number of environments; all arrays (n,)."""

    environments: NDArray[Any]
    rates: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]


def convergence(passed: ArrayLike, confidence: float = 0.95) -> Convergence:
    """Follow the results (n,), 0 or 1, in the order of their environments."""
    from scipy.special import betaincinv

    check_confidence(confidence)
    results = numpy.asarray(passed, dtype=float)
    if results.ndim != 1 or not len(results) or not numpy.all((results == 0) | (results == 1)):
        raise FoldcarError("convergence needs a list of at least one result, each 0 or 1")
    successes = results.cumsum()
    runs = numpy.arange(1, len(results) + 1)
    tail = (1 - confidence) / 2
    low, high = (betaincinv(successes + 0.5, runs - successes + 0.5, p) for p in (tail, 1 - tail))
    low, high = numpy.where(successes == 0, 0.0, low), numpy.where(successes == runs, 1.0, high)
    return Convergence(runs, successes / runs, low, high)


def more_for_half_width(successes: int, runs: int, half_width: float, confidence: float = 0.95) -> int:
    """How many more environments bring the interval's half-width to ``half_width``, 0 to 0.5, if the rate stays."""
    check_counts(successes, runs)
    if not 0 < half_width < 0.5:
        raise FoldcarError(f"half-width must be between 0 and 0.5, as 0.05; it is {half_width:g}")

    def too_wide(total: int) -> bool:
        low, high = jeffreys_interval(successes / runs * total, total, confidence)
        return (high - low) / 2 > half_width

    if not too_wide(runs):
        return 0
    enough = runs
    while too_wide(enough):
        enough *= 2
        if enough > MOST_RUNS:
            raise FoldcarError(f"a half-width of {half_width:g} needs more than {MOST_RUNS} environments")
    short = enough // 2
    while enough - short > 1:
        middle = (short + enough) // 2
        short, enough = (middle, enough) if too_wide(middle) else (short, middle)
    return enough - runs


def chance_of_crossing(successes: int, runs: int, threshold: float, more: int) -> float:
    """The probability, 0 to 1, that after ``more`` environments the rate is on the other side of ``threshold``.

    The further successes are beta-binomial, given those so far and Jeffreys' prior.
    """
    from scipy.stats import betabinom

    check_counts(successes, runs)
    if not 0 < threshold < 1:
        raise FoldcarError(f"threshold must be between 0 and 1, as 0.75; it is {threshold:g}")
    further = betabinom(more, successes + 0.5, runs - successes + 0.5)
    # Fewer further successes than this leave the rate below the threshold.
    needed = int(numpy.ceil(threshold * (runs + more) - successes - 1e-9))
    below = float(further.cdf(needed - 1))
    return below if successes >= threshold * runs else 1 - below


def advice(successes: int, runs: int, half_width: float, threshold: float | None = None, confidence: float = 0.95) -> str:
    """Whether more environments pay, in one sentence; against a threshold, or for a half-width."""
    low, high = jeffreys_interval(successes, runs, confidence)
    more = more_for_half_width(successes, runs, half_width, confidence)
    width = (
        f"the half-width is at most {100 * half_width:g} points"
        if not more
        else f"about {more} more environments for a half-width of {100 * half_width:g} points"
    )
    if threshold is None:
        return f"{successes} of {runs} passed, {100 * low:.0f} to {100 * high:.0f} %: {width}."
    side = "above" if successes >= threshold * runs else "below"
    if not low <= threshold <= high:
        return f"{successes} of {runs} passed: {side} {100 * threshold:g} %, which more environments will hardly change."
    chance = chance_of_crossing(successes, runs, threshold, runs)
    return (
        f"{successes} of {runs} passed: not decided against {100 * threshold:g} %; as many environments again would move "
        f"the rate from {side} it with a probability of {100 * chance:.0f} %."
    )
