"""Answers read from draws: rates, chances, what the trials have taught, surprises."""

import numpy
import pytest

from foldcar.belief.answers import believe, estimates
from foldcar.belief.priors import NAMES, ScorePrior
from foldcar.belief.trials import Trials
from hand_learned import DESIGNS, hand_learned


def test_estimates_are_weighted_means_and_quantiles() -> None:
    values = numpy.arange(1, 1001.0)[:, None] / 1000
    weights = numpy.where(values[:, 0] > 0.5, 2.0, 1.0)

    (estimate,) = estimates(values, weights / weights.sum())

    # Of the weight, a third lies evenly below one half.
    assert estimate.value == pytest.approx(0.25 / 3 + 0.75 * 2 / 3, abs=0.001)
    assert estimate.low == pytest.approx(0.025 * 1.5, abs=0.002)
    assert estimate.high == pytest.approx(1 - 0.025 * 0.75, abs=0.002)


def test_before_trials_the_interval_is_wide_and_the_better_half_is_best() -> None:
    answers = believe(hand_learned(0.0, 2.0, friction=1.0), DESIGNS, Trials.of_counts([]))

    assert not answers.driven
    assert answers.best == 4
    assert answers.built[2].low < 0.1
    assert answers.built[2].high > 0.9
    assert answers.chances(0.5)[2] == pytest.approx(0.5, abs=0.06)
    assert answers.best_chances.sum() == pytest.approx(1)


def test_trials_narrow_the_unknown_that_decides() -> None:
    learned = hand_learned(0.0, 0.0, obstacle_height=-3.0)

    unknowns = believe(learned, DESIGNS, Trials.of_counts([(0, 1, 20), (4, 2, 20)])).unknowns

    by_name = {unknown.parameter.name: unknown for unknown in unknowns}
    assert by_name["obstacle_height"].taught
    assert by_name["obstacle_height"].after.value > 1.05
    assert not by_name["friction"].taught
    assert by_name["obstacle_height"].before.value == pytest.approx(1.0, abs=0.02)


def test_a_measured_value_that_the_trials_contradict_may_be_wrong() -> None:
    index = NAMES.index("obstacle_height")
    known = {index: ScorePrior(-2.0, 0.1, "measured")}

    answers = believe(
        hand_learned(0.0, 0.0, obstacle_height=-3.0), DESIGNS, Trials.of_counts([(0, 0, 30), (4, 1, 30)]), known, [index]
    )

    assert answers.unknowns[index].wrong > 0.5
    assert answers.unknowns[index].measured == pytest.approx(numpy.exp(-0.4), abs=0.01)


def test_a_car_has_its_own_rate() -> None:
    trials = Trials(
        numpy.array([2, 2]), ("red", "blue"), numpy.array([0, 1]), numpy.array([19.0, 5.0]), numpy.array([20.0, 20.0]),
        numpy.zeros(2),
    )  # fmt: skip

    red, blue = believe(hand_learned(friction=1.0), DESIGNS, trials).cars

    assert (red.name, red.passed, red.counted) == ("red", 19, 20)
    assert red.rate.value > 0.75 > 0.5 > blue.rate.value


def test_a_design_unlike_all_others_is_a_surprise() -> None:
    # Log-odds are the same everywhere; all but the middle design pass nearly always.
    counts = [(0, 38, 40), (1, 39, 40), (2, 2, 40), (3, 39, 40), (4, 38, 40)]

    answers = believe(hand_learned(3.0, friction=0.5), DESIGNS, Trials.of_counts(counts))

    assert [surprise.design for surprise in answers.surprises] == [2]


def test_the_unexplained_error_grows_where_no_reality_fits() -> None:
    # In every reality all designs are good; several cars of each wide design fail.
    counts = [(design, passed, 20) for design, passed in ((0, 19), (0, 18), (1, 19), (3, 1), (3, 0), (4, 1), (4, 2))]

    answers = believe(hand_learned(2.0, friction=0.3), DESIGNS, Trials.of_counts(counts))

    assert answers.unexplained_has_grown


def test_trials_as_expected_surprise_nobody() -> None:
    answers = believe(hand_learned(1.0, friction=0.5), DESIGNS, Trials.of_counts([(0, 14, 20), (4, 15, 20)]))

    assert answers.surprises == []
    assert not answers.unexplained_has_grown


def test_realities_are_drawn_by_their_weights() -> None:
    learned = hand_learned(0.0, 0.0, obstacle_height=-3.0)
    before = believe(learned, DESIGNS, Trials.of_counts([]))
    after = believe(learned, DESIGNS, Trials.of_counts([(2, 0, 30)]))

    column = NAMES.index("obstacle_height")
    heights = [numpy.median(answers.realities(400)[0][:, column]) for answers in (before, after)]

    assert heights[0] == pytest.approx(1.0, abs=0.03)
    assert heights[1] > 1.1
