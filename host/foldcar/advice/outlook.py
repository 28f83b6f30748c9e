"""What is believed of every design of an experiment before the next trials: the numbers that a selection goes by.

Input: evidence. Output: an Outlook, arrays over the candidates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from foldcar.advice.evidence import DesignEvidence, Evidence, columns
from foldcar.analysis.pooled_bias import MOST_POOLED, NONE, Contradictions, contradictions, pooled_bias
from foldcar.analysis.rate import Rate
from foldcar.analysis.smoothed_simulation import smoothed_simulation

# More designs are thinned out: information is counted for every pair of them.
MOST_CANDIDATES = 400
DRAWS = 3000


@dataclass(frozen=True)
class Outlook:
    """The candidates of a selection, D designs of one family with runs.

    ``parameters`` (D, k); ``trials`` (D, 2) passed and all; ``draws`` (draws, D) of the true rates; ``passed`` (D,
    environments): what simulation says in each, NaN where there is no run; ``samples`` (environments,).
    ``pooled`` are the rates that trials and simulation give together, None before two designs, or all, were driven.
    ``smooth`` (D, 3) is simulation's success, smoothed over designs, with its band (rate, low, high).
    ``contradicting``: designs whose trials contradict the others'.
    """

    designs: tuple[DesignEvidence, ...]
    parameters: NDArray[Any]
    trials: NDArray[Any]
    draws: NDArray[Any]
    samples: NDArray[Any]
    passed: NDArray[Any]
    pooled: tuple[Rate, ...] | None
    thinned: int
    smooth: NDArray[Any]
    contradicting: Contradictions = NONE

    @property
    def driven(self) -> bool:
        """Whether there are trials that count."""
        return bool(self.trials[:, 1].any())


def outlook(evidence: Evidence) -> Outlook | None:
    """The outlook of an experiment; None if no design of it has runs."""
    family = [one for one in evidence.designs if one.swept and one.runs]
    if not family:
        return None
    # Trials of designs that the sweep lacks inform their neighbours.
    others = [one for one in evidence.driven if one.runs and not one.swept and evidence.in_family(one)]
    # Of many driven designs those with most trials tell most.
    driven = sorted((one for one in (*family, *others) if one.trials), key=lambda one: -len(one.trials))
    told = {id(one) for one in driven[:MOST_POOLED]}
    designs = [*_thinned(family, told), *(one for one in others if id(one) in told)]
    x, runs, trials = columns(designs, evidence.parameters)
    samples, passed = _matrix(designs)
    thinned = len(family) + len(others) - len(designs)
    # Threads for matrices of some tens of rows only wait for each other.
    with threadpool_limits(1):
        cars = [one.cars for one in designs]
        simulation = smoothed_simulation(x, runs, passed)
        bias = pooled_bias(x, runs, trials, cars, simulation)
        # Of one driven design nothing is pooled: enough where there is no other.
        pooled = tuple(bias.rates()) if (trials[:, 1] > 0).sum() >= min(2, len(designs)) else None
        draws, smooth = bias.draws(DRAWS), simulation.rates()
        contradicting = contradictions(x, runs, trials, cars, simulation)
    return Outlook(tuple(designs), x, trials, draws, samples, passed, pooled, thinned, smooth, contradicting)


def _thinned(family: Sequence[DesignEvidence], told: set[int]) -> list[DesignEvidence]:
    """The designs of the family whose id() is in ``told``, and evenly spaced ones without trials."""
    rest = [index for index, one in enumerate(family) if not one.trials]
    kept = set(rest)
    if len(family) > MOST_CANDIDATES:
        kept &= set(numpy.linspace(0, len(family) - 1, MOST_CANDIDATES).round().astype(int).tolist())
    return [one for index, one in enumerate(family) if index in kept or id(one) in told]


def _matrix(designs: Sequence[DesignEvidence]) -> tuple[NDArray[Any], NDArray[Any]]:
    samples = numpy.unique(numpy.concatenate([one.samples for one in designs]))
    passed = numpy.full((len(designs), len(samples)), numpy.nan)
    for row, one in enumerate(designs):
        passed[row, numpy.searchsorted(samples, one.samples)] = one.passed
    return samples, passed
