"""Stopping rules: whether a design has enough runs, for `foldcar sweep --until` and `foldcar optimize`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.rate import anytime_interval

# A design gets no further runs if these would decide it with a lower probability than this.
MIN_CHANCE = 0.02
# The near horizon is this many times the runs so far.
NEAR_HORIZON = 10
# Fractions of the greatest possible stake, in bets that a design is not worse.
STAKES = numpy.arange(1, 10)[:, None] / 10
# Rounding error of sums of losses (rates, seconds or joules).
ROUNDING = 1e-9


@dataclass(frozen=True)
class StoppingRule:
    """Says when a design has enough runs, by its anytime-valid interval of ``confidence``.

    It is decided if half the interval's width is at most ``half_width`` (0 to 1). If ``half_width`` is None, it is
    decided if the interval lies on one side of each of the ``thresholds`` (0 to 1, ascending).
    """

    half_width: float | None
    thresholds: tuple[float, ...]
    confidence: float = 0.95

    def decided(self, successes: ArrayLike, runs: ArrayLike) -> NDArray[Any]:
        """Return whether each design (designs,) is decided after that many successes and runs."""
        low, high = anytime_interval(successes, runs, self.confidence)
        if self.half_width is not None:
            return numpy.asarray((high - low) / 2 <= self.half_width)
        sides = [(low > threshold) | (high < threshold) for threshold in self.thresholds]
        return numpy.asarray(numpy.all(sides, axis=0))

    def chance(self, rates: ArrayLike, masses: ArrayLike, passed: int, runs: int, later_runs: int) -> float:
        """Return the probability that a design is decided when it has ``later_runs`` runs.

        So far it has ``runs`` runs, of which ``passed`` passed. Its success rate is unknown: it is each of ``rates`` (n,)
        with the probability in ``masses`` (n,).
        """
        from scipy.stats import binom

        new_passed = self._deciding_new_passed(passed, runs, later_runs)
        # For each success rate and each of these numbers of passed runs, the probability of this number.
        probabilities = binom.pmf(new_passed, later_runs - runs, numpy.asarray(rates)[:, None])
        chance_at_rates = probabilities.sum(axis=1)
        return float(numpy.asarray(masses) @ chance_at_rates)

    def _deciding_new_passed(self, passed: int, runs: int, later_runs: int) -> NDArray[Any]:
        """Return how many of the new runs may pass so that the design is decided with them, such as [9, 10] of 10.

        So far ``passed`` of its ``runs`` passed. With the new runs it has ``later_runs`` runs.
        """
        new_passed = numpy.arange(later_runs - runs + 1)
        is_decided = _decided(self, later_runs)
        return numpy.asarray(new_passed[is_decided[passed + new_passed]])

    def hopeless(self, passed: int, runs: int, max_runs: int) -> bool:
        """Return whether the rule has little chance to decide a design, even with ``max_runs`` runs.

        So far ``passed`` of its ``runs`` passed. Little chance means a probability below MIN_CHANCE, computed with
        Jeffreys' prior. A rule with a ``half_width`` always has a chance, because further runs narrow the interval.
        """
        if self.half_width is not None:
            return False
        # A smaller number of runs is tried first: its chance is computed faster, and often it is already large enough.
        fewer_runs = min(max_runs, NEAR_HORIZON * (runs + 1))
        if _later_chance(self, passed, runs, fewer_runs) >= MIN_CHANCE:
            return False
        return _later_chance(self, passed, runs, max_runs) < MIN_CHANCE

    @classmethod
    def from_facts(cls, facts: Mapping[str, Any]) -> "StoppingRule":
        """Make the rule from its fields, as a store keeps them in JSON."""
        return cls(**{**facts, "thresholds": tuple(facts["thresholds"])})

    @property
    def text(self) -> str:
        """The condition for a design to be decided, as a clause: ``its 95 % interval is …``."""
        interval = f"its {100 * self.confidence:g} % interval"
        if self.half_width is not None:
            points = "point" if self.half_width == 0.01 else "points"
            return f"{interval} is at most {100 * self.half_width:g} percentage {points} to each side"
        places = " and of ".join(f"{100 * threshold:g} %" for threshold in self.thresholds)
        return f"{interval} lies on one side of {places}"


@lru_cache(maxsize=256)
def _decided(rule: StoppingRule, runs: int) -> NDArray[Any]:
    """Return whether a design is decided with 0, 1, … ``runs`` passed runs (runs + 1,)."""
    return rule.decided(numpy.arange(runs + 1), runs)


@lru_cache(maxsize=4096)
def _later_chance(rule: StoppingRule, passed: int, runs: int, later_runs: int) -> float:
    """Return the probability that a design is decided when it has ``later_runs`` runs.

    So far it has ``runs`` runs, of which ``passed`` passed. Its success rate is unknown, with Jeffreys' prior.
    """
    from scipy.stats import betabinom

    new_passed = rule._deciding_new_passed(passed, runs, later_runs)
    # The posterior of the rate is a beta distribution. Jeffreys' prior adds half a run to each of its parameters.
    probabilities = betabinom.pmf(new_passed, later_runs - runs, passed + 0.5, runs - passed + 0.5)
    return float(probabilities.sum())


def evidence_of_worse(excess: ArrayLike, number: int, max_advantage: float) -> float:
    """Return a score that is high if a design is worse than another one, after some of ``number`` environments.

    ``excess`` (n,) is the loss of the design minus the loss of the other one, in each environment so far. The order of
    environments is random. No excess is below -``max_advantage``. The design is worse if the sum of the excess over all
    environments is above 0. If it is not worse, the score may still be high by chance, but rarely: the probability that
    it reaches 10 after any environment is at most 1/10, and so on. The score is infinite if the design is certainly
    worse, because the remaining environments cannot bring the sum down to 0.

    Let x_i be the excess in environment i of N, and b ``max_advantage``. If the sum is at most 0, the mean of x_i given
    those before is at most μ_i = -(x_1 + … + x_(i-1)) / (N - i + 1). So Π (1 + c (x_i - μ_i) / (b + μ_i)) is a
    supermartingale for each stake c of 0 to 1, and so is its mean over STAKES (Ville's inequality; Waudby-Smith and
    Ramdas 2020, 2006.04347).
    """
    x = numpy.asarray(excess, dtype=float)
    earlier_sum = numpy.cumsum(x) - x
    environments_left = number - numpy.arange(len(x))
    # μ_i and b + μ_i. If the latter is 0, every remaining excess must be -b, or the sum is above 0.
    max_mean = -earlier_sum / environments_left
    denominators = max_advantage + max_mean
    is_zero = denominators < ROUNDING
    if (is_zero & (x - max_mean > ROUNDING)).any():
        return math.inf
    gains = numpy.divide(x - max_mean, denominators, out=numpy.zeros(len(x)), where=~is_zero)
    # There is a product over the environments for each stake. The score is the mean of these products.
    products = numpy.prod(1 + STAKES * gains, axis=1)
    return float(products.mean())
