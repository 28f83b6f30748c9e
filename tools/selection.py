"""Measures whether `foldcar select` finds the best width with less work than a uniform choice, and where it ends.

Synthetic truths: simulation's success over 37 widths is a plateau with two smooth edges; in log-odds the true rates, of
a further car of each width, differ from it by a shift and a smooth random curve. Cars of a width differ in log-odds as 20
simulated ones of it do, from which the rates' model knows it. Both choices end with the width of the highest posterior
mean, from the same model, and build and drive of each width as many cars as `foldcar select` plans; only the widths
differ: those that it names, or one at random of each quarter of the range. Printed by round: the mean loss (points of
success that the picked width lacks against the best) and how often it lacks at most 5 points. Then, where a rule first
says that it is enough: how often it does within MAX_ROUNDS, after how many trials, cars and hours, what the leader lacks
and how often that is more than 5 points, and shares of widths that are decided, or wrongly so.

Example: python tools/selection.py --truths 60
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy
from synthetic_trials import SIMULATED_CARS, centre_of, logistic, of_built
from threadpoolctl import threadpool_limits

from foldcar.inference.adviser import MAX_LOSS, MIN_GAIN, ROUND_TRIALS
from foldcar.inference.costs import PLACING_MIN, car_min
from foldcar.inference.selecting import PRECISION
from foldcar.statistics.built_cars import SPREADS, BuiltCars, simulated_weights
from foldcar.statistics.pooled_bias import pooled_bias
from foldcar.statistics.selection import (
    BATCHES,
    Effort,
    choose_designs,
    correlation_within_cars,
    expected_loss,
    first_designs,
    further_effort,
    gain_per_hour,
    trials_needed,
)

WIDTHS = numpy.arange(65.0, 250.0, 5.0)
RUNS = 100
THRESHOLD = 0.75
# Designs a round.
BUILD = 4
ROUNDS, MAX_ROUNDS = 2, 6
DRAWS = 600
# Standard deviations of cars' log-odds at both ends of the range and in its middle: as in the width study.
MIN_SPREAD, MAX_SPREAD = 0.6, 1.9
NEAR = 0.05
# Prices at which an hour of work is no longer worth it, 0 to 1; minutes of a trial.
PRICES = (0.0025, 0.005, MIN_GAIN, 0.02)
CAR_MIN, TRIAL_MIN = car_min("W_B_W"), PLACING_MIN + 0.5
STOPS = (
    "ends below, points/h", "ends", "trials (10–90 %)", "cars", "hours", "leader lacks", "over 5 points, %", "decided, %",
    "of all, wrong", "mean's side wrong", "by > 15 points",
)  # fmt: skip


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


@dataclass
class Width:
    """The cars of a width: log-odds of each, their trials passed and all, and how much they differ by simulation."""

    weights: numpy.ndarray
    log_odds: list[float] = field(default_factory=list)
    passed: list[int] = field(default_factory=list)
    counted: list[int] = field(default_factory=list)

    def drive(self, random: numpy.random.Generator, rate: float, spread: float, effort: Effort) -> None:
        """Build and drive cars as planned."""
        more = centre_of(rate, spread) + spread * random.standard_normal(effort.cars)
        self.log_odds += more.tolist()
        for counts in (self.passed, self.counted):
            counts += [0] * effort.cars
        for car, log_odds in enumerate(self.log_odds):
            number = max(0, effort.each - self.counted[car])
            self.passed[car] += int(random.binomial(number, logistic(log_odds)))
            self.counted[car] += number

    @property
    def cars(self) -> BuiltCars:
        """The trials for the model."""
        passed, counted = numpy.array([self.passed, self.counted], dtype=float)
        return BuiltCars(passed, counted, numpy.zeros(len(passed)), self.weights)


@dataclass(frozen=True)
class Round:
    """After a round of trials: what the leader lacks (points of success, 0 to 1), in truth and by the draws.

    ``gain`` is what `foldcar select` ends by, ``designs`` (widths, 4) are lower end, upper end and mean of each believed
    rate, and the truth. Numbers of ``trials`` and ``cars`` so far.
    """

    trials: int
    cars: int
    lacks: float
    loss: float
    gain: float
    designs: numpy.ndarray

    @property
    def hours(self) -> float:
        """What the work took so far."""
        return float(self.cars * CAR_MIN + self.trials * TRIAL_MIN) / 60

    def wrong(self) -> tuple[float, ...]:
        """Shares of widths: decided; decided wrongly; by their mean on the wrong side; and so by more than PRECISION."""
        low, high, mean, truth = self.designs.T
        reaches, fails = low >= THRESHOLD, high < THRESHOLD
        side = (mean >= THRESHOLD) != (truth >= THRESHOLD)
        wrong = (reaches & (truth < THRESHOLD)) | (fails & (truth >= THRESHOLD))
        far = side & (numpy.abs(truth - THRESHOLD) > PRECISION)
        return tuple(float(mask.mean()) for mask in (reaches | fails, wrong, side, far))


def rounds(random: numpy.random.Generator, selecting: bool, most: int) -> list[Round]:
    """Rounds of one synthetic truth."""
    simulated, truth = synthetic(random)
    spreads = numpy.interp(WIDTHS, WIDTHS[[0, len(WIDTHS) // 2, -1]], random.uniform(MIN_SPREAD, MAX_SPREAD, 3)).round(1)
    runs = numpy.column_stack([random.binomial(RUNS, simulated), numpy.full(len(WIDTHS), RUNS)])
    widths: dict[int, Width] = {}
    rounds: list[Round] = []
    draws = pooled_bias(WIDTHS[:, None], runs, numpy.zeros((len(WIDTHS), 2))).draws(DRAWS)
    for number in range(most):
        for index in selected(runs, draws, number) if selecting else uniform(random):
            if index not in widths:
                twins = of_built(random, simulated[[index]], spreads[index], SIMULATED_CARS, 10)
                widths[index] = Width(simulated_weights(twins[0], 10))
            effort = planned(index, draws, widths, 1, trials_needed(draws[:, index], PRECISION))
            widths[index].drive(random, truth[index], spreads[index], effort)
        cars = [widths[index].cars if index in widths else None for index in range(len(WIDTHS))]
        trials = numpy.array([(0, 0) if car is None else (car.passed.sum(), car.counted.sum()) for car in cars])
        bias = pooled_bias(WIDTHS[:, None], runs, trials, cars)
        draws, rates = bias.draws(DRAWS), bias.rates()
        best, loss = expected_loss(draws)
        work = [
            [planned(at, draws, widths, batch).work_min(CAR_MIN, TRIAL_MIN) for at in range(len(WIDTHS))]
            for batch in BATCHES
        ]
        gain = gain_per_hour(draws, THRESHOLD, PRECISION, work)
        ends = numpy.array([(rate.low, rate.high) for rate in rates])
        designs = numpy.column_stack([ends, draws.mean(axis=0), truth])
        built = sum(len(width.log_odds) for width in widths.values())
        rounds.append(Round(int(trials[:, 1].sum()), built, float(truth.max() - truth[best]), loss, gain, designs))
    return rounds


def planned(index: int, draws: numpy.ndarray, widths: dict[int, Width], further: int, least: int = 0) -> Effort:
    """The cars and trials of a width that `foldcar select` plans."""
    spreads = [float(width.weights @ SPREADS) for width in widths.values()]
    spread = float(widths[index].weights @ SPREADS) if index in widths else float(numpy.mean(spreads))
    done = widths[index].counted if index in widths else []
    alike = correlation_within_cars(draws[:, index], spread)
    return further_effort(further, alike, CAR_MIN, TRIAL_MIN, done, least)


def selected(runs: numpy.ndarray, draws: numpy.ndarray, number: int) -> Sequence[int]:
    """The designs of a round as `foldcar select` names them."""
    if number:
        return choose_designs(draws, THRESHOLD, ROUND_TRIALS, BUILD, zone=PRECISION)
    rates = runs[:, 0] / runs[:, 1]
    placed = [design.index for design in first_designs(WIDTHS[:, None], rates, rates * (1 - rates), THRESHOLD)][:BUILD]
    return [*placed, *choose_designs(draws, THRESHOLD, ROUND_TRIALS, BUILD - len(placed), placed)]


def uniform(random: numpy.random.Generator) -> Sequence[int]:
    """As many designs, one of each equal part of the range."""
    parts = numpy.array_split(numpy.arange(len(WIDTHS)), BUILD)
    return [int(random.choice(part)) for part in parts]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--truths", type=int, default=60, help="synthetic truths")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    # Threads for small matrices only wait for each other.
    threadpool_limits(1)
    table = {
        selecting: [
            rounds(numpy.random.default_rng([chosen.seed, number]), selecting, MAX_ROUNDS if selecting else ROUNDS)
            for number in range(chosen.truths)
        ]
        for selecting in (True, False)
    }
    print(f"{chosen.truths} truths; loss of the picked width in points, and how often it is at most {100 * NEAR:.0f}")
    print("round  hours, trials and loss of select; of uniform")
    for number in range(ROUNDS):
        cells = []
        for selecting in (True, False):
            loss = numpy.array([rounds[number].lacks for rounds in table[selecting]])
            error = loss.std(ddof=1) / numpy.sqrt(len(loss))
            work = [
                float(numpy.mean([getattr(rounds[number], name) for rounds in table[selecting]]))
                for name in ("hours", "trials")
            ]
            cells.append(f"{work[0]:4.0f} h {work[1]:4.0f} {100 * loss.mean():5.1f} ± {100 * error:.1f}")
            cells.append(f"{100 * (loss <= NEAR).mean():3.0f} %")
        print(f"{number + 1:5}   {'   '.join(cells)}", flush=True)
    print("\n" + "|".join(["", *STOPS, ""]) + "\n" + "|---" * len(STOPS) + "|")
    for price in PRICES:
        print_stops(table[True], f"{100 * price:g}", partial(below, price))
    print_stops(
        table[True],
        f"{100 * MIN_GAIN:g}, leader unsure",
        lambda round_: round_.loss <= PRECISION and round_.gain < MIN_GAIN,
    )
    print_stops(table[True], "all decided", lambda round_: round_.loss <= MAX_LOSS and round_.wrong()[0] == 1)


def below(price: float, round_: Round) -> bool:
    """Whether an hour of work wins less than the price, and the leader loses little."""
    return round_.loss <= MAX_LOSS and round_.gain < price


def print_stops(truths: Sequence[Sequence[Round]], name: str, enough: Callable[[Round], bool]) -> None:
    """A row of what holds where a rule ends."""
    ends = [next(filter(enough, truth), None) for truth in truths]
    ended = [end for end in ends if end is not None]
    cells = [name, f"{len(ended)} of {len(ends)}"]
    if ended:
        for what in ("trials", "cars", "hours"):
            low, middle, high = numpy.quantile([getattr(end, what) for end in ended], [0.1, 0.5, 0.9])
            cells.append(f"{middle:.0f} ({low:.0f}–{high:.0f})")
        lacks = numpy.array([end.lacks for end in ended])
        cells += [f"{100 * lacks.mean():.1f}", f"{100 * (lacks > NEAR).mean():.0f}"]
        cells += [f"{100 * share:.1f}" for share in numpy.mean([end.wrong() for end in ended], axis=0)]
    print("|" + "|".join(cells + [""] * (len(STOPS) - len(cells))) + "|", flush=True)


if __name__ == "__main__":
    main()
