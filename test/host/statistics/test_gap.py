"""Gaps between simulation and trials, and ranks, against published examples."""

import pytest

from foldcar.statistics.gap import (
    AGREES,
    OPTIMISTIC,
    PESSIMISTIC,
    TOO_FEW,
    Gap,
    rank_agreement,
)
from foldcar.statistics.rate import Rate, wilson_interval
from foldcar.statistics.words import rank_text


def rate(passed: int, number: int) -> Rate:
    return Rate(passed / number, *wilson_interval(passed, number), 0.95, "")


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
