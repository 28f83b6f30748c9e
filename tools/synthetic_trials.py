"""Synthetic truths with known rates, on which tools/interval_coverage.py tries the intervals.

A car passes in an environment with the log-odds centre + spread of the cars z + SCENES b, z and b standard normal. In
simulation the centre is BIAS off (standard deviation), and b correlates with that of the truth.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy

# Environments that simulation has seen of each design.
ENVIRONMENTS = 100
BIAS, SCENES = 0.5, 1.5
# Cars of a design that simulation sees in each environment of a trial.
SIMULATED_CARS = 20
NORMAL = (numpy.arange(400) + 0.5) / 400


def logistic(log_odds: Any) -> Any:
    """The probability of these log-odds."""
    return 1 / (1 + numpy.exp(-log_odds))


@cache
def centres(deviation: float) -> tuple[Any, Any]:
    """Log-odds, and the mean rate of what lies around each with that standard deviation."""
    from scipy.stats import norm

    at = numpy.linspace(-25, 25, 2001)
    return at, logistic(at[:, None] + deviation * norm.ppf(NORMAL)).mean(axis=1)


def centre_of(rate: Any, deviation: float) -> Any:
    """The log-odds around which what has that mean rate lies."""
    at, rates = centres(deviation)
    return numpy.interp(rate, rates, at)


@dataclass(frozen=True)
class Driven:
    """Cars of a design of true ``rate``: each passed so many of ``each`` trials, ``passed`` (cars,).

    ``simulated``: how many of ten environments each of SIMULATED_CARS passed.
    """

    rate: float
    passed: Any
    each: int
    simulated: Any


def driven(random: numpy.random.Generator, cars: int, each: int, spread: float, count: int) -> Iterator[Driven]:
    """Trials of designs whose rates are uniform, alike in all environments."""
    for _ in range(count):
        rate = random.uniform()
        centre = centre_of(rate, spread)
        rates = logistic(centre + spread * random.standard_normal(cars))
        twins = logistic(centre + BIAS * random.standard_normal() + spread * random.standard_normal(SIMULATED_CARS))
        yield Driven(rate, random.binomial(each, rates), each, random.binomial(10, twins))


@dataclass(frozen=True)
class Placed:
    """``passed`` of ``trials`` of one car, in environments where simulation is known: its rate over all, ``overall``.

    In each of the trials' environments it is ``several``, by SIMULATED_CARS.
    ``rate`` is that of the design, ``simulated`` as in Driven.
    """

    rate: float
    passed: int
    trials: int
    overall: float
    several: list[float]
    simulated: Any


def placed(
    random: numpy.random.Generator, trials: int, spread: float, correlation: float, hard: bool, count: int
) -> Iterator[Placed]:
    """Trials of one car of each design; in environments of which simulation finds most ``hard``, or in any."""
    for _ in range(count):
        rate = random.uniform(0.03, 0.97)
        centre, n = centre_of(rate, float(numpy.hypot(spread, SCENES))), ENVIRONMENTS
        b, noise = random.standard_normal((2, n))
        believed = centre + BIAS * random.standard_normal()
        believed = believed + SCENES * (correlation * b + numpy.sqrt(1 - correlation**2) * noise)
        runs = random.random(n) < logistic(believed + spread * random.standard_normal(n))
        order = numpy.argsort(believed + SCENES * random.standard_normal(n)) if hard else random.permutation(n)
        own_order = random.permutation(order[: 2 * n // 5])[:trials]
        twins = logistic(believed[own_order] + spread * random.standard_normal((SIMULATED_CARS, 1)))
        table = random.random(twins.shape) < twins
        passed = random.random(trials) < logistic(centre + spread * random.standard_normal() + SCENES * b[own_order])
        overall = (runs.sum() + 0.5) / (n + 1)
        several = table.mean(axis=0).tolist()
        # The truth is that of these environments, which a design meets again.
        true = float(logistic(centre + spread * quantiles() + SCENES * b[:, None]).mean())
        yield Placed(true, int(passed.sum()), trials, overall, several, table.sum(axis=1))


@cache
def quantiles() -> Any:
    """Nodes of the normal distribution."""
    from scipy.stats import norm

    return norm.ppf(NORMAL[2::4])


@dataclass(frozen=True)
class Row:
    """Designs in a row: parameters (d, 1), true rates (d,), ``passed`` of so many trials of each car (d, cars).

    ``simulated`` (d,) are simulation's rates, ``twins`` (d, SIMULATED_CARS) how many of ten environments its cars passed.
    """

    parameters: Any
    rates: Any
    passed: Any
    simulated: Any
    twins: Any


def of_built(random: numpy.random.Generator, rates: Any, spread: Any, cars: int, trials: int) -> Any:
    """How many of ``trials`` each of so many cars (d, cars) of designs of these ``rates`` (d,) passes."""
    centres_of = centre_of(rates, spread)[:, None]
    return random.binomial(trials, logistic(centres_of + spread * random.standard_normal((len(rates), cars))))


def rows(
    random: numpy.random.Generator, designs: int, cars: int, trials: int, rough: bool, spread: float, count: int
) -> Iterator[Row]:
    """Rows of designs of which the middle ones pass; trial and simulation differ smoothly, or by each design's own."""
    x = numpy.linspace(0, 1, designs)
    for _ in range(count):
        centre, width, top = random.uniform(0.2, 0.8), random.uniform(0.2, 0.5), random.uniform(1, 4)
        log_odds = numpy.maximum(top - top * ((x - centre) / width) ** 2, -5)
        waves = random.uniform(0, 1.5) * numpy.sin(2 * numpy.pi * (random.uniform(0.2, 1) * x + random.uniform()))
        difference = random.normal(-0.5, 1) + (random.standard_normal(designs) if rough else waves)
        simulated, true = logistic(log_odds), logistic(log_odds + difference)
        runs = random.binomial(ENVIRONMENTS, simulated) / ENVIRONMENTS
        passed = of_built(random, true, spread, cars, trials)
        yield Row(x[:, None], true, passed, runs, of_built(random, simulated, spread, SIMULATED_CARS, 10))
