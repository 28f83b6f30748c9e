"""Measures whether `foldcar select` finds the best width with fewer trials than a uniform choice of widths.

Synthetic truths: simulation's success over 37 widths is a plateau with two smooth edges; in log-odds the true rates
differ from it by a shift and a smooth random curve. Both choices end with the width of the highest posterior mean, from
the same model; only the widths that are tried differ: those that `foldcar select` names, or one at random of each quarter
of the range. Printed by number of trials: the mean loss (points of success that the picked width lacks against the best)
and how often it lacks at most 5 points.

Example: python tools/selection.py --truths 200
"""

import argparse
from collections.abc import Sequence

import numpy
from threadpoolctl import threadpool_limits

from foldcar.analysis.pooled_bias import pooled_bias
from foldcar.analysis.selection import choose, expected_loss, first_designs

WIDTHS = numpy.arange(65.0, 250.0, 5.0)
RUNS = 100
THRESHOLD = 0.75
# Designs a round, and trials of each.
BUILD, TRIALS = 4, 5
ROUNDS = 8
DRAWS = 600
NEAR = 0.05


def plateau(low: float, high: float, edge: float, top: float) -> numpy.ndarray:
    """Success by width: ``top`` between ``low`` and ``high`` (mm), falling over ``edge`` (mm) on both sides."""
    rise, fall = (WIDTHS - low) / edge, (high - WIDTHS) / edge
    success: numpy.ndarray = top / (1 + numpy.exp(-rise)) / (1 + numpy.exp(-fall))
    return success


def synthetic(random: numpy.random.Generator) -> tuple[numpy.ndarray, numpy.ndarray]:
    """Rates (widths,) of simulation and of the truth."""
    simulated = plateau(random.uniform(70, 120), random.uniform(150, 220), random.uniform(4, 10), 0.99)
    share = (WIDTHS - WIDTHS[0]) / numpy.ptp(WIDTHS)
    # A Gaussian process, Matérn 5/2.
    r = numpy.sqrt(5) * numpy.abs(share[:, None] - share[None, :]) / random.uniform(0.12, 0.3)
    root = numpy.linalg.cholesky((1 + r + r**2 / 3) * numpy.exp(-r) + 1e-8 * numpy.eye(len(WIDTHS)))
    curve = 1.5 * root @ random.standard_normal(len(WIDTHS))
    log_odds = numpy.log(simulated / (1 - simulated)).clip(-4, 3)
    return simulated, 1 / (1 + numpy.exp(-(log_odds + random.normal(-2.5, 1) + curve)))


def losses(random: numpy.random.Generator, selecting: bool) -> list[float]:
    """What the picked width lacks against the best after each round of one synthetic truth."""
    simulated, truth = synthetic(random)
    runs = numpy.column_stack([random.binomial(RUNS, simulated), numpy.full(len(WIDTHS), RUNS)])
    trials = numpy.zeros((len(WIDTHS), 2))
    found = []
    draws = pooled_bias(WIDTHS[:, None], runs, trials).draws(DRAWS)
    for number in range(ROUNDS):
        tried = selected(runs, draws, number) if selecting else uniform(random)
        for index in tried:
            trials[index] += random.binomial(TRIALS, truth[index]), TRIALS
        draws = pooled_bias(WIDTHS[:, None], runs, trials).draws(DRAWS)
        best, _ = expected_loss(draws)
        found.append(float(numpy.max(truth) - truth[best]))
    return found


def selected(runs: numpy.ndarray, draws: numpy.ndarray, number: int) -> Sequence[int]:
    """The designs of a round as `foldcar select` names them."""
    if number:
        return choose(draws, THRESHOLD, TRIALS, BUILD)
    rates = runs[:, 0] / runs[:, 1]
    placed = [one.index for one in first_designs(WIDTHS[:, None], rates, rates * (1 - rates), THRESHOLD)][:BUILD]
    return [*placed, *choose(draws, THRESHOLD, TRIALS, BUILD - len(placed), placed)]


def uniform(random: numpy.random.Generator) -> Sequence[int]:
    """As many designs, one of each equal part of the range."""
    parts = numpy.array_split(numpy.arange(len(WIDTHS)), BUILD)
    return [int(random.choice(part)) for part in parts]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--truths", type=int, default=200, help="synthetic truths")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    # Threads for small matrices only wait for each other.
    threadpool_limits(1)
    table = {
        selecting: numpy.array(
            [losses(numpy.random.default_rng([chosen.seed, one]), selecting) for one in range(chosen.truths)]
        )
        for selecting in (True, False)
    }
    print(f"{chosen.truths} truths; loss of the picked width in points, and how often it is at most {100 * NEAR:.0f}")
    print("trials   select            uniform")
    for number in range(ROUNDS):
        cells = []
        for selecting in (True, False):
            loss = table[selecting][:, number]
            error = loss.std(ddof=1) / numpy.sqrt(len(loss))
            cells.append(f"{100 * loss.mean():5.1f} ± {100 * error:.1f}  {100 * (loss <= NEAR).mean():3.0f} %")
        print(f"{(number + 1) * BUILD * TRIALS:6}   {'   '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
