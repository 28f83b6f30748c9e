"""The value of a step, against a case that is computed by hand, and what is never advised."""

import numpy
import pytest

from foldcar.belief import weighing
from foldcar.belief.advice import FAILS, AdvisedStep, steps
from foldcar.belief.answers import Answers, believe
from foldcar.belief.trials import Trials
from hand_learned import DESIGNS, hand_learned


def weighed(answers: Answers, **measurable: tuple[float, float]) -> list[AdvisedStep]:
    return steps(answers, 60.0, lambda design: 3.0, measurable)


def test_a_single_design_has_nothing_to_gain() -> None:
    answers = believe(hand_learned(friction=2.0), DESIGNS[:1], Trials.of_counts([]))

    assert all(step.gain == pytest.approx(0, abs=1e-9) for step in weighed(answers, obstacle_height=(10, 0.1)))


def test_measuring_what_decides_between_designs_is_worth_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    # Friction makes the first or the last design the best.
    monkeypatch.setattr(weighing, "UNEXPLAINED", 1e-9)
    monkeypatch.setattr(weighing, "NOMINAL_CHANCE", 0.0)
    answers = believe(hand_learned(friction=(0.0, 6.0)), DESIGNS, Trials.of_counts([]))

    found = {step.parameter: step for step in weighed(answers, friction=(10, 0.1), track_m=(10, 0.1))}

    # Knowing the sign of the score, one takes the better end: the mean of expit(6 |z|), beside 1/2 without.
    score = numpy.random.default_rng(1).standard_normal(100_000)
    known = (1 / (1 + numpy.exp(-6 * numpy.abs(score)))).mean()
    assert found["friction"].gain == pytest.approx(known - 0.5, abs=0.03)
    assert found["track_m"].gain < 0.02


def test_trials_of_a_decisive_design_are_worth_more_than_of_an_indifferent_one() -> None:
    answers = believe(hand_learned(friction=(0.0, 6.0)), DESIGNS, Trials.of_counts([]))

    gains = {step.design: step.gain for step in weighed(answers) if step.kind == "build"}

    # The middle design's rate is one half whatever the friction, so its trials tell nothing of the ends.
    assert gains[0] > gains[2] + 0.1
    assert gains[4] > gains[2] + 0.1


def test_a_design_that_fails_almost_surely_is_never_a_step() -> None:
    answers = believe(hand_learned(-4.0, 9.0, friction=0.3), DESIGNS, Trials.of_counts([(4, 30, 40), (0, 0, 40)]))

    designs = {step.design for step in weighed(answers)} - {None}

    built = [step.design for step in weighed(answers) if step.kind == "build"]
    assert answers.built[0].high < FAILS
    assert 0 not in built
    assert 4 in designs


def test_steps_stand_in_the_order_of_their_gain_for_an_hour() -> None:
    answers = believe(hand_learned(friction=(0.0, 3.0)), DESIGNS, Trials.of_counts([(0, 5, 10)]))

    found = weighed(answers, friction=(10, 0.1))

    assert [step.gain_per_hour for step in found] == sorted((step.gain_per_hour for step in found), reverse=True)
    assert {step.kind for step in found} == {"build", "drive", "measure"}
    assert [step.second for step in found if step.kind == "build" and step.design == 0] == [True]
