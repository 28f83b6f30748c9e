"""Synthetic truths with known rates, on which tools/interval_coverage.py tries the intervals."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy

# Environments that only simulation has seen.
OTHERS = 500
# Environments that simulation has seen of each design, those of the trials included.
ENVIRONMENTS = 100


@dataclass(frozen=True)
class Pairs:
    """Trials (n,) of a design whose true rate is ``rate``, simulation's results with them (n,) and elsewhere (N,)."""

    rate: float
    trials: Any
    paired: Any
    others: Any


def logistic(log_odds: Any) -> Any:
    """The probability of these log-odds."""
    return 1 / (1 + numpy.exp(-log_odds))


def binary_pairs(random: numpy.random.Generator, trials: int, correlation: float, count: int) -> Iterator[Pairs]:
    """Results 0 or 1 of the given correlation; true rates uniform, simulation's log-odds 0.5 off (deviation).

    Simulation's rate is drawn again until such a correlation is possible with it.
    """
    for _ in range(count):
        rate = random.uniform()
        while True:
            simulated = logistic(numpy.log(rate / (1 - rate)) + 0.5 * random.standard_normal())
            both = rate * simulated + correlation * numpy.sqrt(rate * (1 - rate) * simulated * (1 - simulated))
            if both <= min(rate, simulated):
                break
        results = paired_results(random, rate, simulated, both, trials)
        yield Pairs(rate, *results, (random.random(OTHERS) < simulated).astype(float))


def paired_results(
    random: numpy.random.Generator, rate: float, simulated: float, both: float, count: int
) -> tuple[Any, Any]:
    """Trials and simulated results (count,), 0 or 1, with these probabilities of either and of both."""
    draws = random.random(count)
    trial = draws < rate
    only_simulated = (draws >= rate) & (draws < rate + simulated - both)
    return trial.astype(float), ((draws < both) | only_simulated).astype(float)


@dataclass(frozen=True)
class Row:
    """Designs in a row: parameters (d, 1), true rates, passed of ``trials`` each, and simulation's rates (d,)."""

    parameters: Any
    rates: Any
    passed: Any
    trials: int
    simulated: Any


def rows(
    random: numpy.random.Generator, designs: int, trials: int, rough: bool, correlation: float, count: int
) -> Iterator[Row]:
    """Rows of designs of which the middle ones pass; trial and simulation differ smoothly, or by each design's own.

    Within a design they correlate as given, or as far as their rates allow.
    """
    x = numpy.linspace(0, 1, designs)
    for _ in range(count):
        centre, width, top = random.uniform(0.2, 0.8), random.uniform(0.2, 0.5), random.uniform(1, 4)
        log_odds = numpy.maximum(top - top * ((x - centre) / width) ** 2, -5)
        waves = random.uniform(0, 1.5) * numpy.sin(2 * numpy.pi * (random.uniform(0.2, 1) * x + random.uniform()))
        difference = random.normal(-0.5, 1) + (random.standard_normal(designs) if rough else waves)
        simulated, true = logistic(log_odds), logistic(log_odds + difference)
        passed, runs = numpy.zeros(designs), numpy.zeros(designs)
        for design, (p, s) in enumerate(zip(true, simulated, strict=True)):
            both = min(p * s + correlation * numpy.sqrt(p * (1 - p) * s * (1 - s)), p, s)
            y, f = paired_results(random, p, s, both, max(trials, ENVIRONMENTS))
            passed[design], runs[design] = y[:trials].sum(), f[:ENVIRONMENTS].mean()
        yield Row(x[:, None], true, passed, trials, runs)
