"""Draws weighed by trials, against integrals over one unknown that are computed directly."""

import numpy
import pytest
from scipy.special import expit

from foldcar.belief import weighing
from foldcar.belief.priors import MAX_SCORE, NAMES, ScorePrior
from foldcar.belief.trials import Trials
from foldcar.belief.weighing import Prior, weigh
from hand_learned import DESIGNS, hand_learned

GRID = numpy.linspace(-6, 6, 4001)
NORMAL = numpy.exp(-(GRID**2) / 2) / numpy.exp(-(GRID**2) / 2).sum()
FRICTION = NAMES.index("friction")


@pytest.fixture
def only_scores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave nothing uncertain but the scores."""
    for name in ("UNEXPLAINED", "CAR_SD"):
        monkeypatch.setattr(weighing, name, 1e-9)
    monkeypatch.setattr(weighing, "NOMINAL_CHANCE", 0.0)


def mean_rate(draws: weighing.Draws, design: int) -> float:
    return float(draws.weights @ expit(draws.log_odds(numpy.array([design]))[:, 0]))


@pytest.mark.usefixtures("only_scores")
@pytest.mark.parametrize("least", [0, 10**9], ids=["weighed", "moved"])
def test_the_posterior_mean_is_the_integral(least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weighing, "MIN_EFFECTIVE", least)
    prior = Prior(hand_learned(0.5, friction=1.5), DESIGNS, {})

    draws = weigh(prior, Trials.of_counts([(1, 2, 12)]))

    rates = expit(0.5 + 1.5 * numpy.clip(GRID, -MAX_SCORE, MAX_SCORE))
    posterior = NORMAL * rates**2 * (1 - rates) ** 10
    assert mean_rate(draws, 3) == pytest.approx(posterior @ rates / posterior.sum(), abs=0.006)
    assert draws.weights @ draws.scores[:, FRICTION] == pytest.approx(posterior @ GRID / posterior.sum(), abs=0.03)


@pytest.mark.usefixtures("only_scores")
def test_cars_of_a_design_differ(monkeypatch: pytest.MonkeyPatch) -> None:
    # The design's rate is one half for sure; a car that passed 9 of 10 is better than its design.
    monkeypatch.setattr(weighing, "CAR_SD", 1.0)
    monkeypatch.setattr(weighing, "CAR_SD_LOG_SD", 1e-9)

    draws = weigh(Prior(hand_learned(), DESIGNS, {}), trials := Trials.of_counts([(0, 9, 10)]))

    posterior = NORMAL * expit(GRID) ** 9 * (1 - expit(GRID))
    assert mean_rate(draws, 0) == pytest.approx(0.5, abs=0.001)
    own = draws.weights @ draws.car_rates(trials)[:, 0]
    assert own == pytest.approx(posterior @ expit(GRID) / posterior.sum(), abs=0.02)


@pytest.mark.usefixtures("only_scores")
def test_a_measured_value_is_known_to_its_precision() -> None:
    known = {FRICTION: ScorePrior(1.0, 0.1, "measured")}

    draws = weigh(Prior(hand_learned(friction=1.0), DESIGNS, known), Trials.of_counts([]))

    assert draws.weights @ draws.scores[:, FRICTION] == pytest.approx(1.0, abs=0.005)
    assert numpy.std(draws.scores[:, FRICTION]) == pytest.approx(0.1, rel=0.05)


@pytest.mark.usefixtures("only_scores")
def test_a_wrong_measurement_is_found() -> None:
    # The ruler says that obstacles are low, so that nearly all pass; none of 40 trials did.
    measured = {FRICTION: ScorePrior(2.0, 0.1, "measured")}
    prior = Prior(hand_learned(friction=2.0), DESIGNS, measured, frozenset([FRICTION]))

    before, after = (weigh(prior, Trials.of_counts(counts)) for counts in ([], [(2, 0, 40)]))

    assert before.weights @ before.wrong[:, FRICTION] == pytest.approx(weighing.WRONG, abs=0.01)
    assert after.weights @ after.wrong[:, FRICTION] > 0.95


@pytest.mark.usefixtures("only_scores")
def test_easy_scenes_count_less() -> None:
    prior = Prior(hand_learned(friction=1.5), DESIGNS, {})
    car = numpy.array([0])

    def rate(scene_ease: float) -> float:
        trials = Trials(car, (None,), car, numpy.array([8.0]), numpy.array([10.0]), numpy.array([scene_ease]))
        return mean_rate(weigh(prior, trials), 0)

    assert rate(1.0) < rate(0.0) - 0.05 < rate(-1.0) - 0.1


def test_nothing_passes_where_nothing_can() -> None:
    prior = Prior(hand_learned(-6.0), DESIGNS, {})

    draws = weigh(prior, Trials.of_counts([(2, 0, 30)]))

    assert all(mean_rate(draws, design) < 0.03 for design in range(5))


def test_trials_of_one_design_tell_of_others_through_a_reality() -> None:
    prior = Prior(hand_learned(friction=3.0), DESIGNS, {})

    bad, good = (weigh(prior, Trials.of_counts([(0, passed, 20)])) for passed in (1, 19))

    assert mean_rate(bad, 4) < 0.25
    assert mean_rate(good, 4) > 0.75


def test_draws_are_always_enough() -> None:
    prior = Prior(hand_learned(1.0, 2.0, friction=1.0), DESIGNS, {})
    contradicting = [(design, 60 * (design % 2), 60) for design in range(5)]

    assert weigh(prior, Trials.of_counts(contradicting)).effective >= weighing.MIN_EFFECTIVE


def test_the_smooth_part_is_a_matern_process() -> None:
    prior = Prior(hand_learned(), DESIGNS, {})
    columns = prior.smooth_columns(DESIGNS)

    distance = numpy.sqrt(5) * numpy.abs(DESIGNS - DESIGNS.T) / 100 / weighing.LENGTH
    matern = (1 + distance + distance**2 / 3) * numpy.exp(-distance)
    assert columns.T @ columns == pytest.approx(matern, abs=0.1)
