"""Measures how often the 95 % intervals hold the truth, and how many trials simulation saves; renews docs/statistics.md.

Usage: interval_coverage.py PAGE. Synthetic truths with fixed seeds; rates are drawn uniformly, since the coverage of
results 0 or 1 at a single rate jumps with n. Output: the page with its tables replaced, and the figure beside it.
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

import matplotlib
import matplotlib.figure
import numpy
from page_block import replaced
from scipy.special import betainc, betaincinv, betaln, xlog1py, xlogy
from scipy.stats import binom, norm
from synthetic_trials import ENVIRONMENTS, binary_pairs, rows

from foldcar.analysis.contradictions import contradictions
from foldcar.analysis.gaussian_process import success_model
from foldcar.analysis.pooled_bias import pooled_bias
from foldcar.analysis.rate import (
    anytime_interval,
    clopper_pearson_interval,
    jeffreys_interval,
    limited_mean,
    power_tuned_mean,
    rectified_rate,
    wilson_interval,
)
from foldcar.figures.output import save_figure
from foldcar.figures.style import ACCENT, FAILURE, INK, RC
from foldcar.outputs import atomic_file

MARKS = {
    "coverage": ("<!-- coverage of tools/interval_coverage.py -->", "<!-- end of coverage -->"),
    "contradictions": ("<!-- contradictions of tools/interval_coverage.py -->", "<!-- end of contradictions -->"),
    "saved": ("<!-- saved of tools/interval_coverage.py -->", "<!-- end of saved -->"),
}
PICTURE = "\n![Trials that simulation saves](statistics/saved.png)\n"
COUNTS = (10, 20, 50, 100)
CORRELATIONS = (0.0, 0.5, 0.9)
CURVE = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9)
CURVE_COUNTS = (10, 50)
# Synthetic truths of each cell.
REPEATS = 2000
ROWS = 200
DESIGNS = 19
# Studies that are checked for contradictions; least rate of a design and its neighbours; how deep a lone design falls.
CHECKED, LEAST_GOOD = 50, 0.7
DIPS = (0.0, 0.5, 0.7)
STUDIES = ((5, 10), (9, 10), (9, 20))
SEED = 1007
# A time limit, and the spread of the logarithms of times.
LIMIT_S, SPREAD = 20.0, 0.6
# Each of them: was the truth held, and how wide was the interval.
Cell = tuple[float, float]
# Correlations and the shares of trials saved at them, by name of the estimator.
Savings = dict[str, tuple[Sequence[float], list[float]]]


def share(found: Iterator[tuple[float, float, float]]) -> Cell:
    """The coverage and mean width of (truth, low, high)."""
    table = numpy.array(list(found))
    held = (table[:, 1] <= table[:, 0]) & (table[:, 0] <= table[:, 2])
    return float(held.mean()), float((table[:, 2] - table[:, 1]).mean())


def exact(interval: Callable[[int, int], tuple[float, float]], n: int) -> Cell:
    """Coverage and width over all numbers of successes, for rates uniform over 0 to 1."""
    ends = [interval(k, n) for k in range(n + 1)]
    # The probability of k successes is 1/(n+1), and the rate is then Beta(k+1, n-k+1).
    held = [betainc(k + 1, n - k + 1, high) - betainc(k + 1, n - k + 1, low) for k, (low, high) in enumerate(ends)]
    return float(numpy.mean(held)), float(numpy.mean([high - low for low, high in ends]))


def rectified(correlation: float, n: int) -> Cell:
    """Trials that rectify simulation."""
    random = numpy.random.default_rng(SEED)
    pairs = binary_pairs(random, n, correlation, REPEATS)
    rates = ((pair.rate, rectified_rate(pair.trials, pair.paired, pair.others)) for pair in pairs)
    return share((truth, rate.low, rate.high) for truth, rate in rates)


def normal_rectified(correlation: float, n: int) -> Cell:
    """The normal interval of PPI++, which foldcar does not use."""
    reach = norm.ppf(0.975)

    def intervals() -> Iterator[tuple[float, float, float]]:
        for pair in binary_pairs(numpy.random.default_rng(SEED), n, correlation, REPEATS):
            y, f, others = pair.trials, pair.paired, pair.others
            weight = numpy.cov(y, f)[0, 1] / ((1 + n / len(others)) * max(numpy.append(f, others).var(ddof=1), 1e-12))
            weight = min(max(weight, 0.0), 1.0)
            error = numpy.sqrt((y - weight * f).var(ddof=1) / n + weight**2 * others.var(ddof=1) / len(others))
            value = power_tuned_mean(y, f, others)
            yield pair.rate, value - reach * error, value + reach * error

    return share(intervals())


def pooled(rough: bool, correlation: float, n: int) -> Cell:
    """Designs in a row, their bias pooled."""

    def intervals() -> Iterator[tuple[float, float, float]]:
        for row in rows(numpy.random.default_rng(SEED), DESIGNS, n, rough, correlation, ROWS):
            runs = numpy.column_stack([ENVIRONMENTS * row.simulated, numpy.full(DESIGNS, ENVIRONMENTS)])
            trials = numpy.column_stack([row.passed, numpy.full(DESIGNS, n)])
            found = pooled_bias(row.parameters, runs, trials).rates()
            yield from ((truth, rate.low, rate.high) for truth, rate in zip(row.rates, found, strict=True))

    return share(intervals())


def contradicted(driven: int, n: int, dip: float) -> tuple[float, float]:
    """Of studies with smooth bias, the share in which a design is named that fits the others, and that of dips named.

    ``driven`` of the designs have n trials. The rate of one between good ones is ``dip`` lower, if that is above 0.
    """
    random = numpy.random.default_rng([SEED, driven, n, round(100 * dip)])
    chosen = numpy.linspace(1, DESIGNS - 2, driven).round().astype(int)
    named, found = [], []
    for row in rows(random, DESIGNS, n, False, 0.0, 20 * CHECKED):
        true = row.rates[chosen]
        good = [at for at in range(1, driven - 1) if true[at - 1 : at + 2].min() >= max(dip, LEAST_GOOD)]
        if dip and not good:
            continue
        at = int(random.choice(good)) if dip else 0
        true[at] -= dip
        trials = numpy.zeros((DESIGNS, 2))
        trials[chosen] = numpy.column_stack([random.binomial(n, true), numpy.full(driven, n)])
        runs = numpy.column_stack([ENVIRONMENTS * row.simulated, numpy.full(DESIGNS, ENVIRONMENTS)])
        flagged = set(contradictions(row.parameters, runs, trials).designs)
        found.append(chosen[at] in flagged)
        named.append(bool(flagged - ({chosen[at]} if dip else set())))
        if len(found) == CHECKED:
            break
    return float(numpy.mean(named)), float(numpy.mean(found))


def restricted(n: int) -> Cell:
    """The mean time up to the limit: log-normal times, up to half beyond it."""
    random = numpy.random.default_rng(SEED)
    grid = norm.ppf((numpy.arange(20_000) + 0.5) / 20_000)

    def intervals() -> Iterator[tuple[float, float, float]]:
        for _ in range(REPEATS):
            middle = random.uniform(numpy.log(5), numpy.log(LIMIT_S))
            times = numpy.exp(middle + SPREAD * random.standard_normal(n))
            crossed = times[times < LIMIT_S]
            found = limited_mean(len(crossed), n, float(crossed.sum()), float((crossed**2).sum()), LIMIT_S)
            truth = numpy.minimum(numpy.exp(middle + SPREAD * grid), LIMIT_S).mean()
            yield float(truth), *found[1:]

    return share(intervals())


def smooth(n: int) -> Cell:
    """The band of the success model, over designs in a row."""
    random = numpy.random.default_rng(SEED)

    def intervals() -> Iterator[tuple[float, float, float]]:
        for row in rows(random, DESIGNS, n, False, 0.0, ROWS):
            _, low, high = success_model(row.parameters, row.passed, numpy.full(DESIGNS, n)).rates(row.parameters)
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


def saved(paired_width: float, n: int, alone: Callable[[int], float]) -> float:
    """The share of trials saved: n trials are as precise as so many, for which ``alone`` gives the width."""
    counts = numpy.unique(numpy.round(n * numpy.geomspace(0.7, 12, 60)).astype(int))
    widths = numpy.array([alone(int(count)) for count in counts])
    return 1 - n / float(numpy.interp(-paired_width, -widths, counts))


def jeffreys_widths(n: int) -> Any:
    """The widths (n + 1,) of Jeffreys' interval for each number of successes; as jeffreys_interval, for all at once."""
    k = numpy.arange(n + 1)
    low, high = (betaincinv(k + 0.5, n - k + 0.5, part) for part in (0.025, 0.975))
    return numpy.where(k == n, 1.0, high) - numpy.where(k == 0, 0.0, low)


def alone_uniform(n: int) -> float:
    """The mean width of Jeffreys' interval for uniform rates."""
    return float(jeffreys_widths(n).mean())


def alone_in_rows(n: int) -> float:
    """The expected width of Jeffreys' interval for the rates of the rows of designs."""
    return float((binom.pmf(numpy.arange(n + 1), n, rates_in_rows()[:, None]) @ jeffreys_widths(n)).mean())


@cache
def rates_in_rows() -> Any:
    """True rates of the rows of designs, every 13th: their distribution."""
    random = numpy.random.default_rng(SEED)
    return numpy.concatenate([row.rates for row in rows(random, DESIGNS, 1, False, 0.4, ROWS)])[::13]


LINES: dict[str, Callable[[int], Cell]] = {
    "Wilson (counts in figures)": partial(exact, wilson_interval),
    "Jeffreys (trials alone)": partial(exact, jeffreys_interval),
    "Clopper-Pearson": partial(exact, clopper_pearson_interval),
    **{f"trials and simulation, ρ = {value:g}": partial(rectified, value) for value in CORRELATIONS},
    "the same, normal interval of PPI++, ρ = 0.5": partial(normal_rectified, 0.5),
    "designs pooled, smooth bias, ρ = 0.4": partial(pooled, False, 0.4),
    "designs pooled, rough bias, ρ = 0.4": partial(pooled, True, 0.4),
    "restricted mean time": restricted,
    "smooth success model": smooth,
    "anytime-valid, at every look up to n": anytime,
}


def main(page: Path) -> None:
    """Measure everything and renew the page and its figure."""
    with ProcessPoolExecutor(2) as pool:
        cells = {(name, n): pool.submit(line, n) for name, line in LINES.items() for n in COUNTS}
        late = pool.submit(anytime, 10_000)
        curve = {(n, value): pool.submit(rectified, value, n) for n in CURVE_COUNTS for value in CURVE}
        in_rows = {(n, value): pool.submit(pooled, False, value, n) for n in CURVE_COUNTS for value in CURVE[::2]}
        rough = {n: pool.submit(pooled, True, 0.4, n) for n in CURVE_COUNTS}
        table = [["95 % interval, n =", *(f"{n}" for n in COUNTS)]]
        table += [[name, *(f"{100 * cells[name, n].result()[0]:.1f}" for n in COUNTS)] for name in LINES]
        savings: Savings = {
            f"paired, n = {n}": (CURVE, [saved(curve[n, v].result()[1], n, alone_uniform) for v in CURVE])
            for n in CURVE_COUNTS
        }
        savings |= {
            f"pooled, n = {n}": (CURVE[::2], [saved(in_rows[n, v].result()[1], n, alone_in_rows) for v in CURVE[::2]])
            for n in CURVE_COUNTS
        }
        rough_saved = {n: saved(rough[n].result()[1], n, alone_in_rows) for n in CURVE_COUNTS}
        named = contradictions_table({(at, dip): pool.submit(contradicted, *at, dip) for at in STUDIES for dip in DIPS})
        print(f"anytime-valid, at every look up to 10,000: {100 * late.result()[0]:.1f} %")
        for name in LINES:
            print(name, *(f"{cells[name, n].result()[1]:.3f}" for n in COUNTS))
    text = page.read_text(encoding="utf-8")
    text = replaced(text, page, *MARKS["coverage"], markdown(table))
    text = replaced(text, page, *MARKS["contradictions"], markdown(named))
    text = replaced(text, page, *MARKS["saved"], markdown(savings_table(savings, rough_saved)) + PICTURE)
    with atomic_file(page) as binary:
        binary.write(text.encode())
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    with matplotlib.rc_context(RC):
        save_figure(drawing(savings), folder / "saved.png", colours=64)


def contradictions_table(checked: dict[tuple[tuple[int, int], float], Future[tuple[float, float]]]) -> list[list[str]]:
    """Rows of how many designs are named (%), by designs, trials of each, and depth of a lone dip."""
    table = [
        ["named, % of studies", *("a fitting one" if not dip else f"one {100 * dip:.0f} points lower" for dip in DIPS)]
    ]
    for driven, n in STUDIES:
        cells = [f"{100 * checked[(driven, n), DIPS[0]].result()[0]:.0f}"]
        for other, dip in (checked[(driven, n), dip].result() for dip in DIPS[1:]):
            cells.append(f"{100 * dip:.0f} (a fitting one: {100 * other:.0f})")
        table.append([f"{driven} driven designs, {n} trials each", *cells])
    return table


def savings_table(savings: Savings, rough_saved: dict[int, float]) -> list[list[str]]:
    """Rows of trials saved (%) by correlation."""
    table = [["trials saved, %, at ρ =", *(f"{value:g}" for value in CURVE)]]
    for name, (values, shares) in savings.items():
        found = dict(zip(values, shares, strict=True))
        table.append([name, *(f"{100 * found[v]:.0f}" if v in found else "" for v in CURVE)])
    table += [
        [f"pooled, n = {n}, rough bias", *(f"{100 * part:.0f}" if v == 0.4 else "" for v in CURVE)]
        for n, part in rough_saved.items()
    ]
    return table


def drawing(savings: Savings) -> Any:
    """Trials saved by correlation."""
    figure = matplotlib.figure.Figure(figsize=(6.0, 3.2), layout="constrained")
    axes = figure.subplots()
    fine = numpy.linspace(0, 0.95, 50)
    axes.plot(fine, 100 * fine**2, color="#999999", linestyle=":", label="limit of pairing, ρ²")
    for (name, (values, shares)), colour, marker in zip(
        savings.items(), (ACCENT, ACCENT, FAILURE, FAILURE), "osos", strict=True
    ):
        filled = colour if marker == "o" else "white"
        axes.plot(values, 100 * numpy.array(shares), marker=marker, color=colour, markerfacecolor=filled, label=name)
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set_xlabel("correlation ρ of trial and simulation within a design")
    axes.set_ylabel("trials saved (%)")
    axes.set_title("Trials that simulation saves")
    figure.legend(loc="outside right center")
    return figure


def markdown(table: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first row is its head."""
    lines = [table[0], ["---"] * len(table[0]), *table[1:]]
    return "".join("|" + "|".join(cells) + "|\n" for cells in lines)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
