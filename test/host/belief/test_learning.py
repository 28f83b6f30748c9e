"""The learned success rate: its regression against scikit-learn's, its rate and its error against a known truth."""

import numpy
import pytest
from scipy.special import expit

from foldcar.belief.learning import learn, penalised_logistic
from foldcar.belief.priors import NAMES
from foldcar.errors import FoldcarError
from foldcar.store.reality_runs import BLOCK, CHECK, RealityRuns

DESIGNS = numpy.arange(65.0, 246, 15)[:, None]
SCENES = 30


def true_log_odds(scores: numpy.ndarray, width_mm: numpy.ndarray) -> numpy.ndarray:
    """A truth that is no product of the features: obstacles decide wide cars, friction all, with a step."""
    friction, height = scores[:, 0], scores[:, 3]
    return 2.5 * numpy.sin((width_mm - 60) / 60) + 0.9 * friction - 1.5 * numpy.tanh(height) * (width_mm > 120)


def simulated_runs(number: int, scene_sd: float = 0.0, seed: int = 3) -> tuple[RealityRuns, numpy.ndarray]:
    """Runs of the truth, of which the first of each block share reality and design; and the scenes' offsets."""
    random = numpy.random.default_rng(seed)
    numbers = numpy.arange(number)
    group = numpy.where(numbers % BLOCK < CHECK, numbers // BLOCK, number + numbers)
    _, of_group = numpy.unique(group, return_inverse=True)
    scores = numpy.clip(random.standard_normal((of_group.max() + 1, len(NAMES))), -2.5, 2.5)[of_group]
    design = random.integers(len(DESIGNS), size=of_group.max() + 1)[of_group]
    sample = random.integers(SCENES, size=number)
    offsets = scene_sd * random.standard_normal(SCENES)
    rates = expit(true_log_odds(scores, DESIGNS[design, 0]) + offsets[sample])
    passed = (random.random(number) < rates).astype(float)
    return RealityRuns(scores, design, sample, passed, numbers), offsets


def test_the_regression_is_scikit_learns() -> None:
    linear_model = pytest.importorskip("sklearn.linear_model")
    random = numpy.random.default_rng(1)
    features = random.standard_normal((400, 6))
    passed = (random.random(400) < expit(features @ [2, -1, 0.5, 0, 0, 0])).astype(float)

    ours = penalised_logistic(features, passed, numpy.ones(400), numpy.full(6, 0.3))

    theirs = linear_model.LogisticRegression(C=0.3, fit_intercept=False, tol=1e-10, max_iter=1000).fit(features, passed)
    assert ours == pytest.approx(theirs.coef_[0], abs=1e-4)


def test_separable_runs_have_finite_coefficients() -> None:
    # Without a penalty the coefficient would be infinite.
    features, passed = numpy.array([[-1.0], [1.0]]), numpy.array([0.0, 1.0])

    coefficients = penalised_logistic(features, passed, numpy.ones(2), numpy.ones(1))

    # At the maximum of 2 log expit(b) - b²/2.
    assert coefficients[0] == pytest.approx(2 / (1 + numpy.exp(coefficients[0])), abs=1e-6)


def test_the_rate_is_learned_and_its_error_is_known() -> None:
    runs, _ = simulated_runs(8000)

    learned = learn(runs, DESIGNS)

    random = numpy.random.default_rng(9)
    scores = numpy.clip(random.standard_normal((300, len(NAMES))), -2.5, 2.5)
    truth = numpy.column_stack([expit(true_log_odds(scores, numpy.full(300, width))) for width in DESIGNS[:, 0]])
    error = numpy.sqrt(((expit(learned.log_odds(scores, DESIGNS)) - truth) ** 2).mean())
    assert error < 0.09
    assert learned.error is not None
    assert learned.error == pytest.approx(error, abs=0.035)


def test_more_runs_teach_more() -> None:
    errors = []
    for number in (1000, 16000):
        learned = learn(simulated_runs(number)[0], DESIGNS)
        scores = numpy.clip(numpy.random.default_rng(9).standard_normal((300, len(NAMES))), -2.5, 2.5)
        truth = numpy.column_stack([expit(true_log_odds(scores, numpy.full(300, width))) for width in DESIGNS[:, 0]])
        errors.append(numpy.abs(expit(learned.log_odds(scores, DESIGNS)) - truth).mean())

    assert errors[1] < 0.6 * errors[0]


def test_easier_scenes_are_known() -> None:
    runs, offsets = simulated_runs(12000, scene_sd=0.8)

    learned = learn(runs, DESIGNS)

    assert numpy.corrcoef([learned.scene_offsets[sample] for sample in range(SCENES)], offsets)[0, 1] > 0.9


def test_failed_simulations_teach_nothing() -> None:
    runs, _ = simulated_runs(1000)
    runs.passed[::10] = numpy.nan

    assert learn(runs, DESIGNS).runs == 900


def test_without_runs_nothing_is_learned() -> None:
    runs, _ = simulated_runs(200)

    with pytest.raises(FoldcarError, match="no runs in other realities"):
        learn(runs.taken(numpy.zeros(200, bool)), DESIGNS)


def test_one_design_is_a_family() -> None:
    runs, _ = simulated_runs(2000)
    alone = RealityRuns(runs.scores, numpy.zeros(2000, int), runs.sample, runs.passed, runs.number)

    learned = learn(alone, DESIGNS[:1])

    assert expit(learned.log_odds(runs.scores, DESIGNS[:1])).mean() == pytest.approx(runs.passed.mean(), abs=0.02)
