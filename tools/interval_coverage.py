"""Measures how often the 95 % intervals hold the truth, with cars that differ and without; renews docs/statistics.md.

Usage: interval_coverage.py PAGE. Synthetic truths with fixed seeds; rates are drawn uniformly, since the coverage of
results 0 or 1 at a single rate jumps with n. Output: the page with its tables replaced.
"""

import os

# One thread each: the processes share the cores.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy
from page_block import replaced
from scipy.special import betainc, betaln, xlog1py, xlogy
from scipy.stats import norm
from synthetic_trials import ENVIRONMENTS, driven, of_built, placed, rows

from foldcar.outputs import atomic_file
from foldcar.statistics import built_cars
from foldcar.statistics.built_cars import PRIOR, BuiltCars, simulated_weights
from foldcar.statistics.gaussian_process import success_model
from foldcar.statistics.pooled_bias import contradictions, pooled_bias
from foldcar.statistics.rate import (
    anytime_interval,
    clopper_pearson_interval,
    limited_mean,
    wilson_interval,
)

MARKS = {
    "coverage": ("<!-- coverage of tools/interval_coverage.py -->", "<!-- end of coverage -->"),
    "cars": ("<!-- cars of tools/interval_coverage.py -->", "<!-- end of cars -->"),
    "scenes": ("<!-- scenes of tools/interval_coverage.py -->", "<!-- end of scenes -->"),
    "contradictions": ("<!-- contradictions of tools/interval_coverage.py -->", "<!-- end of contradictions -->"),
}
COUNTS = (10, 20, 50, 100)
# Cars and trials of each; standard deviations of cars' log-odds.
CARS = ((1, 4), (2, 2), (4, 1), (1, 12), (2, 6), (4, 3))
SPREADS = (0.0, 1.0, 2.0)
# Correlation of environments in simulation and in truth, and whether trials are where simulation finds most of them hard.
PLACES = ((0.9, True), (0.5, True), (0.9, False), (0.5, False))
PLACED_TRIALS = 8
# Synthetic truths of each cell.
REPEATS = 2000
CAR_REPEATS = 400
ROWS, POOLED_ROWS = 200, 40
# Cars of each design, whether its bias is its own, how much its cars differ, and whether simulated cars tell.
POOLED = (
    *((1, rough, spread, False) for rough in (False, True) for spread in SPREADS),
    *((cars, True, spread, cars == 1) for cars in (1, 2) for spread in SPREADS[1:]),
)
DESIGNS = 19
# Studies that are checked for contradictions; least rate of a design and its neighbours; how deep a lone design falls.
CHECKED, MIN_GOOD = 50, 0.7
DIPS = (0.0, 0.5, 0.7)
# Driven designs, trials of each, cars of each, and how much these differ.
STUDIES = (*((*case, 1, spread) for spread in (0.0, 1.0) for case in ((5, 10), (9, 10), (9, 20))), (9, 20, 2, 1.0))
SEED = 1007
# A time limit, and the spread of the logarithms of times.
LIMIT_S, SPREAD = 20.0, 0.6
# Each of them: was the truth held, and how wide was the interval.
Cell = tuple[float, float]


def share(intervals: Iterator[tuple[float, float, float]]) -> Cell:
    """The coverage and mean width of (truth, low, high)."""
    table = numpy.array(list(intervals))
    covered = (table[:, 1] <= table[:, 0]) & (table[:, 0] <= table[:, 2])
    return float(covered.mean()), float((table[:, 2] - table[:, 1]).mean())


def exact(interval: Callable[[int, int], tuple[float, float]], n: int) -> Cell:
    """Coverage and width over all numbers of successes, for rates uniform over 0 to 1."""
    ends = [interval(k, n) for k in range(n + 1)]
    # The probability of k successes is 1/(n+1), and the rate is then Beta(k+1, n-k+1).
    coverage = [betainc(k + 1, n - k + 1, high) - betainc(k + 1, n - k + 1, low) for k, (low, high) in enumerate(ends)]
    return float(numpy.mean(coverage)), float(numpy.mean([high - low for low, high in ends]))


@cache
def assumed(passed: tuple[int, ...], each: int) -> tuple[float, float]:
    """The interval of a further car where nothing is known of how much cars differ."""
    k = numpy.array(passed, dtype=float)
    rate = BuiltCars(k, numpy.full(len(k), float(each)), numpy.zeros(len(k)), PRIOR).rate()
    return rate.low, rate.high


def of_cars(cars: int, each: int, spread: float) -> list[Cell]:
    """Wilson's interval for the cars that drove and for the design, then a further car's: spread assumed, simulated."""
    columns: list[list[tuple[float, float, float]]] = [[], [], [], []]
    for study in driven(numpy.random.default_rng(SEED), cars, each, spread, CAR_REPEATS):
        wilson = wilson_interval(int(study.passed.sum()), cars * each)
        passed, counted, shifts = numpy.array([study.passed, numpy.full(cars, each), numpy.zeros(cars)], dtype=float)
        known = BuiltCars(passed, counted, shifts, simulated_weights(study.simulated, 10)).rate()
        ends = (wilson, wilson, assumed(tuple(sorted(study.passed.tolist())), each), (known.low, known.high))
        for pairs, truth, (low, high) in zip(
            columns, (study.these, study.rate, study.rate, study.rate), ends, strict=True
        ):
            pairs.append((truth, low, high))
    return [share(iter(pairs)) for pairs in columns]


def of_places(correlation: float, hard: bool, spread: float) -> list[tuple[float, float]]:
    """Mean error and coverage of a further car's rate without simulation of the environments, by single runs, by cars."""
    ways: list[tuple[str, float]] = [("", 0.0), ("single", 1.0), ("several", 0.5), ("several", 1.0)]
    by_way: list[list[tuple[float, float]]] = [[] for _ in ways]
    places = placed(numpy.random.default_rng(SEED), PLACED_TRIALS, spread, correlation, hard, CAR_REPEATS)
    for place in places:
        weights = simulated_weights(place.simulated, PLACED_TRIALS)
        for (way, trust), pairs in zip(ways, by_way, strict=True):
            expected = getattr(place, way) if way else []
            by = built_cars.shift(expected, place.overall) * trust / built_cars.TRUST
            passed, counted, shifts = numpy.array([[place.passed], [place.trials], [by]], dtype=float)
            rate = BuiltCars(passed, counted, shifts, weights).rate()
            pairs.append((abs(rate.value - place.rate), float(rate.low <= place.rate <= rate.high)))
    return [(float(error), float(covered)) for error, covered in (numpy.mean(pairs, axis=0) for pairs in by_way)]


def built(passed: Any, each: int, weights: Sequence[Any]) -> list[BuiltCars]:
    """Designs' cars that passed so many (designs, cars) of ``each`` trials."""
    return [
        BuiltCars(counts, numpy.full(len(counts), float(each)), numpy.zeros(len(counts)), weight)
        for counts, weight in zip(passed.astype(float), weights, strict=True)
    ]


def pooled(cars: int, rough: bool, spread: float, simulated_spread: bool, n: int) -> Cell:
    """Pool the bias of designs in a row, n trials each; ``simulated_spread``: the spread is that of simulated cars."""

    def intervals() -> Iterator[tuple[float, float, float]]:
        for row in rows(numpy.random.default_rng(SEED), DESIGNS, cars, n // cars, rough, spread, POOLED_ROWS):
            runs = numpy.column_stack([ENVIRONMENTS * row.simulated, numpy.full(DESIGNS, ENVIRONMENTS)])
            trials = numpy.column_stack([row.passed.sum(axis=1), numpy.full(DESIGNS, n)])
            weights = [simulated_weights(twin, 10) if simulated_spread else PRIOR for twin in row.twins]
            rates = pooled_bias(row.parameters, runs, trials, built(row.passed, n // cars, weights)).rates()
            yield from ((truth, rate.low, rate.high) for truth, rate in zip(row.rates, rates, strict=True))

    return share(intervals())


def pooled_name(cars: int, rough: bool, spread: float, simulated_spread: bool) -> str:
    """The name of such a line."""
    way, of = "rough" if rough else "smooth", "1 car" if cars == 1 else f"{cars} cars"
    return f"{of} a design, {way} bias pooled, σ = {spread:g}, {'simulated' if simulated_spread else 'assumed'}"


def contradicted(driven: int, n: int, cars: int, spread: float, dip: float) -> tuple[float, float]:
    """Of studies with smooth bias, the share in which a design is named that fits the others, and that of dips named.

    ``driven`` of the designs have n trials. The rate of one between good ones is ``dip`` lower, if that is above 0.
    Without ``spread`` all cars are alike, and known to be so; else how much they differ is assumed.
    """
    random = numpy.random.default_rng([SEED, driven, n, round(100 * dip)])
    chosen = numpy.linspace(1, DESIGNS - 2, driven).round().astype(int)
    named, cells = [], []
    for row in rows(random, DESIGNS, cars, n // cars, False, spread, 20 * CHECKED):
        true = row.rates[chosen]
        good = [at for at in range(1, driven - 1) if true[at - 1 : at + 2].min() >= max(dip, MIN_GOOD)]
        if dip and not good:
            continue
        at = int(random.choice(good)) if dip else 0
        true[at] -= dip
        passed = of_built(random, true, spread, cars, n // cars)
        trials = numpy.zeros((DESIGNS, 2))
        trials[chosen] = numpy.column_stack([passed.sum(axis=1), numpy.full(driven, n)])
        known = dict(zip(chosen.tolist(), built(passed, n // cars, [PRIOR] * driven), strict=True))
        runs = numpy.column_stack([ENVIRONMENTS * row.simulated, numpy.full(DESIGNS, ENVIRONMENTS)])
        who = [known.get(index) for index in range(DESIGNS)] if spread else None
        flagged = set(contradictions(row.parameters, runs, trials, who).designs)
        cells.append(chosen[at] in flagged)
        named.append(bool(flagged - ({chosen[at]} if dip else set())))
        if len(cells) == CHECKED:
            break
    return float(numpy.mean(named)), float(numpy.mean(cells))


def restricted(n: int) -> Cell:
    """The mean time up to the limit: log-normal times, up to half beyond it."""
    random = numpy.random.default_rng(SEED)
    grid = norm.ppf((numpy.arange(20_000) + 0.5) / 20_000)

    def intervals() -> Iterator[tuple[float, float, float]]:
        for _ in range(REPEATS):
            middle = random.uniform(numpy.log(5), numpy.log(LIMIT_S))
            times = numpy.exp(middle + SPREAD * random.standard_normal(n))
            crossed = times[times < LIMIT_S]
            interval = limited_mean(len(crossed), n, float(crossed.sum()), float((crossed**2).sum()), LIMIT_S)
            truth = numpy.minimum(numpy.exp(middle + SPREAD * grid), LIMIT_S).mean()
            yield float(truth), *interval[1:]

    return share(intervals())


def smooth(n: int) -> Cell:
    """The band of the success model, over designs in a row."""
    random = numpy.random.default_rng(SEED)

    def intervals() -> Iterator[tuple[float, float, float]]:
        for row in rows(random, DESIGNS, 1, n, False, 0.0, ROWS):
            _, low, high = success_model(row.parameters, row.passed[:, 0], numpy.full(DESIGNS, n)).rates(row.parameters)
            yield from zip(row.rates, low, high, strict=True)

    return share(intervals())


def anytime(n: int) -> Cell:
    """The anytime-valid interval at every look up to n, all of which must hold the rate; width at n."""
    random = numpy.random.default_rng(SEED)
    rates = random.uniform(size=(REPEATS, 1))
    runs = numpy.arange(1, n + 1)
    passed = (random.random((REPEATS, n)) < rates).cumsum(axis=1)
    # As in anytime_interval, but at the true rate: no ends to look for.
    mixed = betaln(passed + 0.5, runs - passed + 0.5) - betaln(0.5, 0.5)
    inside = mixed - xlogy(passed, rates) - xlog1py(runs - passed, -rates) <= -numpy.log(0.05)
    low, high = anytime_interval(passed[:, -1], numpy.full(REPEATS, n))
    return float(inside.all(axis=1).mean()), float((high - low).mean())


LINES: dict[str, Callable[[int], Cell]] = {
    "Wilson (counts in figures)": partial(exact, wilson_interval),
    "Clopper-Pearson": partial(exact, clopper_pearson_interval),
    **{pooled_name(*case): partial(pooled, *case) for case in POOLED},
    "restricted mean time": restricted,
    "smooth success model": smooth,
    "anytime-valid, at every look up to n": anytime,
}


def main(page: Path) -> None:
    """Measure everything and renew the page."""
    with ProcessPoolExecutor(2) as pool:
        cells = {(name, n): pool.submit(line, n) for name, line in LINES.items() for n in COUNTS}
        late = pool.submit(anytime, 10_000)
        cars = {(car, spread): pool.submit(of_cars, *car, spread) for car in CARS for spread in SPREADS}
        places = {(place, spread): pool.submit(of_places, *place, spread) for place in PLACES for spread in SPREADS[:2]}
        table = [["95 % interval, n =", *(f"{n}" for n in COUNTS)]]
        table += [[name, *(f"{100 * cells[name, n].result()[0]:.1f}" for n in COUNTS)] for name in LINES]
        named = contradictions_table({(at, dip): pool.submit(contradicted, *at, dip) for at in STUDIES for dip in DIPS})
        print(f"anytime-valid, at every look up to 10,000: {100 * late.result()[0]:.1f} %")
        for name in LINES:
            print(name, *(f"{cells[name, n].result()[1]:.3f}" for n in COUNTS))
        of = [["interval", "σ", *(f"{n} × {each}" for n, each in CARS)]]
        names = ("Wilson, of these cars", "Wilson, of the design", "further car, σ assumed", "further car, σ simulated")
        for at, name in enumerate(names):
            for spread in SPREADS:
                results = [cars[car, spread].result()[at] for car in CARS]
                of.append(
                    [name, f"{spread:g}", *(f"{100 * covered:.0f} ({100 * width:.0f})" for covered, width in results)]
                )
        head = ("counts alone", "single runs", "several cars, half", "several cars, all")
        scenes = [["trials in", "correlation", "σ", *head]]
        for (correlation, hard), spread in places:
            where = "hard environments" if hard else "any environments"
            results = places[(correlation, hard), spread].result()
            row = (f"{100 * error:.1f} ({100 * covered:.0f})" for error, covered in results)
            scenes.append([where, f"{correlation:g}", f"{spread:g}", *row])
    text = page.read_text(encoding="utf-8")
    for name, rows_of in (("coverage", table), ("cars", of), ("scenes", scenes), ("contradictions", named)):
        text = replaced(text, page, *MARKS[name], markdown(rows_of))
    with atomic_file(page) as binary:
        binary.write(text.encode())


def contradictions_table(checked: dict[tuple[Any, float], Future[tuple[float, float]]]) -> list[list[str]]:
    """Rows of how many designs are named (%), by designs, trials, cars, and depth of a lone dip."""
    dips = ("a fitting one" if not dip else f"one {100 * dip:.0f} points lower" for dip in DIPS)
    table = [["driven designs", "cars × trials of each", "σ", *dips]]
    for study in STUDIES:
        designs, n, cars, spread = study
        cells = [f"{100 * checked[study, DIPS[0]].result()[0]:.0f}"]
        for other, dip in (checked[study, dip].result() for dip in DIPS[1:]):
            cells.append(f"{100 * dip:.0f} (a fitting one: {100 * other:.0f})")
        table.append([f"{designs}", f"{cars} × {n // cars}", f"{spread:g}", *cells])
    return table


def markdown(table: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first row is its head."""
    lines = [table[0], ["---"] * len(table[0]), *table[1:]]
    return "".join("|" + "|".join(cells) + "|\n" for cells in lines)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
