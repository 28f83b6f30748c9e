"""Comparisons of designs and of simulations."""

import numpy
import pytest
from scipy import stats

from foldcar.analysis.engine_bias import pooled_difference


def test_the_difference_of_two_simulations_is_that_of_plain_quadrature() -> None:
    """Of a new design: N(m, s^2), m standard normal, s half-normal, given log-odds with half a run added."""
    here = numpy.array([[390, 400], [1, 3], [1, 3], [1, 3], [3, 5]])
    there = numpy.array([[300, 400], [2, 3], [2, 3], [2, 3], [0, 0]])

    def log_odds(counts: numpy.ndarray) -> tuple[numpy.ndarray, numpy.ndarray]:
        good, bad = counts[:, 0] + 0.5, counts[:, 1] - counts[:, 0] + 0.5
        return numpy.log(good / bad), 1 / good + 1 / bad

    # The last design has no runs there.
    (a, a_variance), (b, b_variance) = log_odds(here[:4]), log_odds(there[:4])
    m, s = numpy.linspace(-6, 6, 601)[:, None], numpy.linspace(0.005, 6, 600)[None, :]
    density = stats.norm.pdf(m) * stats.norm.pdf(s)
    for difference, noise in zip(a - b, a_variance + b_variance, strict=True):
        density = density * stats.norm.pdf(difference, m, numpy.sqrt(noise + s**2))
    density /= density.sum()
    mean = (density * m).sum()

    found = pooled_difference(here[:, 0], here[:, 1], there[:, 0], there[:, 1])

    assert found[0] == pytest.approx(mean, abs=0.005)
    assert found[1] == pytest.approx((density * ((m - mean) ** 2 + s**2)).sum(), rel=0.005)
    # What varies of the mean with the spread is a part of it that would not be missed by less.
    conditional = (density * m).sum(axis=0) / density.sum(axis=0)
    assert (density.sum(axis=0) * (conditional - mean) ** 2).sum() > 0.02 * found[1]
    # Without any design in both, what was assumed before: 1 of the mean, 1 of the spread.
    assert pooled_difference([3], [4], [0], [0]) == pytest.approx((0, 2), abs=0.06)
