"""Effects and importance of parameters against truths in closed form: additive ones, and one that does nothing."""

from itertools import product
from typing import Any

import numpy
import pytest
from scipy.stats import norm
from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.statistics.effects import Effects, fit_effects

ENVIRONMENTS = 60


def score(x: Any) -> Any:
    """How hard an environment a design passes: additive in radius and length; the width does nothing."""
    radius, length, _ = numpy.asarray(x, dtype=float).T
    return (radius - 50) / 8 - ((length - 80) / 25) ** 2 + 0.4


def family(unequal: bool = False) -> Any:
    """Designs of radius, length and width; with large radii only wide ones, if unequal."""
    grid = product((40, 45, 50, 55, 60), (60, 80, 100, 120), (100, 120, 140))
    return numpy.array([design for design in grid if not unequal or design[2] >= 2 * design[0] + 10], dtype=float)


def fitted(x: Any, seed: int, environments: int = ENVIRONMENTS) -> Effects:
    """Every design in the same environments, of normal difficulty: a design's true rate is the normal's distribution
    at its score, and designs pass or fail together."""
    difficulty = numpy.random.default_rng(seed).standard_normal(environments)
    design, environment = (at.ravel() for at in numpy.indices((len(x), environments)))
    with threadpool_limits(1):
        return fit_effects(x, design, environment, score(x)[design] > difficulty[environment])


def test_bands_hold_an_additive_truth_although_designs_share_environments() -> None:
    x, inside, levels = family(), [], []
    points = numpy.unique(x[:, 1:], axis=0)
    for seed in range(12):
        effect = fitted(x, seed).effect(0)
        # The true effect at each value: the mean over the combinations of the others.
        truth = numpy.array([norm.cdf(score(numpy.insert(points, 0, value, axis=1))).mean() for value in effect.grid])
        shape = truth - truth.mean() + effect.mean.mean()
        inside.append((effect.low <= shape) & (shape <= effect.high))
        levels.append(effect.level[0] <= truth.mean() <= effect.level[1])
        # Designs pass or fail together: differences are known better than the level.
        assert (effect.high - effect.low).max() < effect.level[1] - effect.level[0]

    # Independent runs, as success_model takes them, would hold about half.
    assert numpy.mean(inside) > 0.85
    assert numpy.mean(levels) > 0.8


def test_a_parameter_without_effect_is_flat_over_unequal_combinations() -> None:
    x = family(unequal=True)
    effects = fitted(x, seed=3)
    raw = [norm.cdf(score(x[x[:, 2] == width])).mean() for width in (100, 120, 140)]

    effect = effects.effect(2)

    assert raw[2] - raw[0] > 0.15  # what the average over the designs of each width would show
    assert effect.each_was_run
    assert effect.combinations == 8  # two radii go with all widths
    assert numpy.ptp(effect.mean) < 0.03
    assert effect.low.max() < effect.high.min()
    assert effects.importance()[2].share < 0.02
    # Success over some parameters is a mean over the same combinations of the others, too.
    rate, low, high = effects.standardised([2], [[100], [140]])
    both, _, _ = effects.standardised([0, 2], [[40, 100], [40, 140]])
    assert rate == pytest.approx(effect.mean[[0, 2]]) and (low < rate).all() and (rate < high).all()
    assert abs(both[1] - both[0]) < 0.05
    with pytest.raises(FoldcarError, match="only within the range"):
        effects.standardised([2], [[150]])


def test_designs_that_all_pass_give_no_parameter_an_importance_and_no_rate_above_1() -> None:
    x = family()
    design, environment = (at.ravel() for at in numpy.indices((len(x), 20)))
    with threadpool_limits(1):
        effects = fit_effects(x, design, environment, numpy.ones(len(design)))

    assert effects.importance() == []
    for parameter in range(3):
        effect = effects.effect(parameter)
        assert 0 <= effect.low.min() <= effect.high.max() <= 1


def test_importance_is_sobols_total_index() -> None:
    x = family()
    rate = norm.cdf(score(x)).reshape(5, 4, 3)
    truth = [rate.var(axis=axis).mean() / rate.var() for axis in range(3)]

    importances = fitted(x, seed=0, environments=400).importance()

    assert [importance.share for importance in importances] == pytest.approx(truth, abs=0.06)
    assert [
        importance.low - 0.02 <= true <= importance.high + 0.02
        for importance, true in zip(importances, truth, strict=True)
    ] == [True] * 3


def test_without_pairs_that_differ_in_one_parameter_the_model_makes_them() -> None:
    """Scattered designs, as a search tries them: no two are alike in all but one parameter."""
    random = numpy.random.default_rng(1)
    x = random.uniform((40, 60, 100), (60, 120, 140), (60, 3))

    effects = fitted(x, seed=1, environments=100)
    effect = effects.effect(0)

    assert not effect.each_was_run
    assert effect.combinations == 60
    truth = [norm.cdf(score(numpy.insert(x[:, 1:], 0, value, axis=1))).mean() for value in effect.grid]
    assert effect.mean == pytest.approx(truth, abs=0.1)
    assert effects.importance()[2].share < 0.1 < effects.importance()[0].share
