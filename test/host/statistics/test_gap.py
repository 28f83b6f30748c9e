"""Gaps between simulation and trials, and ranks, against published examples."""

import math

import numpy
import pytest

from foldcar.statistics.gap import (
    AGREES,
    OPTIMISTIC,
    PESSIMISTIC,
    TOO_FEW,
    Gap,
    Rates,
    mean_gap,
    pair_correlation,
    rank_agreement,
)
from foldcar.statistics.rate import Rate, wilson_interval
from foldcar.statistics.words import rank_text


def rate(passed: int, number: int) -> Rate:
    return Rate(passed / number, *wilson_interval(passed, number), 0.95, "")


def test_a_gap_is_newcombes_hybrid_score_interval() -> None:
    # Newcombe 1998, Statistics in Medicine 17, 873, table II, method 10: 56/70 against 48/80, 9/10 against 3/10, 0/10.
    for (driven, simulated), (low, high) in {
        ((56, 70), (48, 80)): (0.0524, 0.3339),
        ((9, 10), (3, 10)): (0.1705, 0.8090),
        ((10, 10), (0, 20)): (0.6791, 1.0),
    }.items():
        gap = mean_gap([Rates(rate(*simulated), rate(*driven))])
        assert (gap.low, gap.high) == pytest.approx((low, high), abs=5e-5)
    # Two alike, which err independently: by the root of two less.
    single, double = (mean_gap([Rates(rate(48, 80), rate(56, 70))] * n) for n in (1, 2))
    ends = (
        single.value + (single.low - single.value) / math.sqrt(2),
        single.value + (single.high - single.value) / math.sqrt(2),
    )
    assert (double.value, double.low, double.high) == pytest.approx((single.value, *ends))


@pytest.mark.parametrize(
    ("both", "driven", "simulated", "neither", "ends"),
    [
        # Newcombe 1998, Statistics in Medicine 17, 2635, table I; Bentur 2009 in Fagerland, Lydersen and Laake 2017.
        (36, 12, 2, 0, (0.0569, 0.3404)),
        (1, 1, 7, 12, (-0.507, -0.026)),
    ],
)
def test_a_gap_of_pairs_is_newcombes_for_paired_proportions(
    both: int, driven: int, simulated: int, neither: int, ends: tuple[float, float]
) -> None:
    counts = both, driven, simulated, neither
    y = [passed for passed, number in zip((True, True, False, False), counts, strict=True) for _ in range(number)]
    f = [passed for passed, number in zip((True, False, True, False), counts, strict=True) for _ in range(number)]

    gap = mean_gap([Rates(rate(sum(f), len(f)), rate(sum(y), len(y)), pair_correlation(y, f))])

    assert (gap.low, gap.high) == pytest.approx(ends, abs=5e-4)


def test_the_mean_of_gaps_covers() -> None:
    random = numpy.random.default_rng(3)
    truth = [(0.3, 0.4), (0.9, 0.8), (0.5, 0.2)]
    covering = 0
    for _ in range(200):
        f = [rate(random.binomial(100, p), 100) for p, _ in truth]
        y = [rate(random.binomial(12, p), 12) for _, p in truth]
        gap = mean_gap([Rates(*pair) for pair in zip(f, y, strict=True)])
        covering += gap.low <= -0.1 <= gap.high
    # 95 % of 200, less three standard deviations.
    assert covering >= 180


def test_verdicts_are_those_of_the_interval() -> None:
    for low, high, verdict in (
        (-0.1, 0.1, AGREES),
        (-0.1, -0.01, AGREES),
        (-0.3, -0.01, OPTIMISTIC),
        (0.01, 0.3, PESSIMISTIC),
        (-0.2, 0.1, TOO_FEW),
    ):
        assert Gap((low + high) / 2, low, high, 0.95).verdict(0.15) == verdict


def test_ranks_are_told_as_far_as_they_are_defined() -> None:
    # The published table: only 95 and 115 mm, equal in simulation, differ otherwise: by 70 - 25 %, which counts for one.
    published = rank_agreement([0.07, 1.0, 1.0, 0.56], [0.0, 0.7, 0.25, 0.0])
    assert published.mmrv == pytest.approx(0.45 / 4)
    assert rank_text(None) is rank_text(rank_agreement([0.1], [0.1])) is None
    # Each of the two is violated by 80 - 30 %.
    assert rank_text(rank_agreement([0.1, 0.9], [0.8, 0.3])) == "Over 2 designs: mean maximum rank violation 0.50."
