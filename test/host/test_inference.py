"""A calibration by a simulator that is a formula: its scatter, and what further trials are expected to tell."""

import math
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import binom, norm, pearsonr

from foldcar.calibration import emulator
from foldcar.calibration.emulator import OTHERS, Emulator, features_of
from foldcar.calibration.experiment import CalibrationRun, SweptDesign, SweptExperiment, TrialCounts
from foldcar.calibration.inference import DRAWS, infer, plan
from foldcar.calibration.parameters import NAMES, PARAMETERS, known_scores, values_of
from foldcar.calibration.posterior import DISCREPANCY
from foldcar.calibration.predictions import HEIGHTS, TRIALS, rank_next_trials
from foldcar.calibration.summary import findings, summarise
from foldcar.errors import FoldcarError

SCENES = 30
WIDTHS = (65.0, 95.0, 115.0, 180.0)
FRICTION = NAMES.index("friction")


def experiment(*terrain: dict[str, Any]) -> SweptExperiment:
    """Four widths in scenes with these pieces of terrain."""
    info: Any = SimpleNamespace(varied=["width_mm"], id="1")
    designs = tuple(SweptDesign({"width_mm": width}, {}, "{}") for width in WIDTHS)
    return SweptExperiment(info, designs, ({"terrain": list(terrain)},) * SCENES)


def linear(friction: float, width: float) -> Emulator:
    """The emulator whose logit is a sum: ``friction`` times its score plus ``width`` times the design's feature."""
    weights = np.zeros((len(PARAMETERS) + 1, 1))
    weights[FRICTION], weights[-1] = friction, width
    return Emulator((((weights, np.zeros(1)),),))


class Formula:
    """In place of carsim: more friction and width pass more often. Keeps the runs that were asked of it."""

    def __init__(self, seed: int) -> None:
        self.experiment, self.seed = experiment(), seed
        self.asked: list[CalibrationRun] = []

    def passed(self, runs: Iterable[CalibrationRun], done: Any) -> list[bool | None]:
        """Whether each passed, by chance."""
        asked = list(runs)
        self.asked += asked
        done(len(asked))
        logits = [2 * np.log(run.values["friction"]) / 0.3 + run.design - 1.5 for run in asked]
        return list(map(bool, np.random.default_rng(len(asked)).random(len(asked)) < expit(logits)))


def test_every_set_of_parameters_is_simulated_in_a_scatter_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check, too: it would otherwise repeat the accidents of the runs that the emulator has learned."""
    monkeypatch.setattr(emulator, "fit", lambda *_: linear(2.0, 1.0))
    simulator: Any = Formula(seed=7)
    counts = TrialCounts((0, 3), (2, 9), (10, 10), False, ())
    told: list[int] = []

    found = infer(simulator, counts, 1000, told.append)

    for runs in (1000, 24_000):
        assert plan(runs, 2).runs == pytest.approx(runs, rel=0.1)
    planned = plan(1000, 2)
    sets = planned.first + planned.second
    learned, check = simulator.asked[: (2 + OTHERS) * sets], simulator.asked[(2 + OTHERS) * sets :]
    assert [run.number for run in learned] == [number for number in range(sets) for _ in range(2 + OTHERS)]
    assert [run.number for run in check] == [sets + n for n in range(DRAWS * planned.scenes) for _ in range(2)]
    # Each set with the designs that have trials, then with others, any of the family.
    sets_of = [[run.design for run in learned[i : i + 2 + OTHERS]] for i in range(0, len(learned), 2 + OTHERS)]
    assert all(designs[:2] == [0, 3] for designs in sets_of)
    assert {design for designs in sets_of for design in designs[2:]} == set(range(len(WIDTHS)))
    # All designs of a set, and all the sets of a draw, share its values; scenes are taken in turn.
    of_number: dict[int, set[Any]] = {}
    for run in simulator.asked:
        of_number.setdefault(run.number, set()).add((tuple(run.values.items()), run.scene))
    assert all(len(values) == 1 for values in of_number.values())
    assert {run.scene for run in learned} == {run.scene for run in check} == set(range(SCENES))
    assert [run.design for run in check] == [0, 3] * (DRAWS * planned.scenes)
    assert [dict(run.values) for run in check[:: 2 * planned.scenes]] == found.draws
    assert len(simulator.asked) == sum(told) == planned.runs and found.check_runs == DRAWS * planned.scenes
    # What is checked are the shares of these runs that passed.
    outcomes = np.random.default_rng(len(check)).random(len(check)) < expit(
        [2 * np.log(run.values["friction"]) / 0.3 + run.design - 1.5 for run in check]
    )
    assert list(found.checked) == pytest.approx([outcomes[0::2].mean(), outcomes[1::2].mean()])
    assert np.array_equal(found.logits, found.emulator.logits(found.posterior.scores, found.features[[0, 3]]))


def inferred(swept: SweptExperiment, counts: TrialCounts, scores: Any, tau: float, emulated: Emulator) -> Any:
    """An inference with these draws of the scores, one discrepancy's sd, and an emulator."""
    posterior = SimpleNamespace(scores=scores, discrepancy=np.full(len(scores), tau))
    return SimpleNamespace(counts=counts, posterior=posterior, emulator=emulated, features=features_of(swept))


def bits_by_quadrature(logits: np.ndarray[Any, Any], tau: float, done: tuple[int, int]) -> float:
    """Information of the next TRIALS of a car with the logits, all equally likely, by plain sums over its discrepancy."""
    z = np.linspace(-6, 6, 121)
    prior = norm.pdf(z) / norm.pdf(z).sum()
    tables = []
    for logit in logits:
        rates = expit(logit + tau * z)
        weights = prior * binom.pmf(done[0], done[1], rates)
        tables.append(binom.pmf(np.arange(TRIALS + 1)[:, None], TRIALS, rates) @ weights / weights.sum())
    table = np.array(tables)
    together = table.mean(axis=0)
    return float((table * np.log2(table / together)).sum(axis=1).mean())


def test_trials_that_were_driven_tell_nothing_of_another_cars_discrepancy_under_lower_obstacles() -> None:
    """At the environment's own height further trials are of the car that was driven; else of a new one."""
    swept = experiment({"kind": "box", "height_m": 0.03})
    scores = np.zeros((400, len(PARAMETERS)))
    scores[:, FRICTION] = np.repeat([-1.0, 1.0], 200)
    counts = TrialCounts((1,), (6,), (12,), False, ())
    # All designs alike, whatever the height: candidates differ by the trials done alone.
    inference = inferred(swept, counts, scores, 0.7, linear(1.0, 0.0))

    found = {(one.design, one.height): one for one in rank_next_trials(inference, swept)}

    assert set(found) == {(design, height) for design in range(len(WIDTHS)) for height in HEIGHTS}
    logits = np.array([-1.0, 1.0])
    new, same = bits_by_quadrature(logits, 0.7, (0, 0)), bits_by_quadrature(logits, 0.7, (6, 12))
    assert same < 0.8 * new
    for (design, height), one in found.items():
        assert one.bits == pytest.approx(same if (design, height) == (1, 1.0) else new, abs=0.003)
        assert one.parameter == "friction"


def test_lower_obstacles_are_a_lower_value_of_their_parameter() -> None:
    """Where height alone decides, a family of heights below the environment's is one of scores moved by its logarithm."""
    swept = experiment({"kind": "pothole", "depth_m": 0.03})
    height = NAMES.index("obstacle_height")
    scores = np.zeros((100, len(PARAMETERS)))
    scores[:, height] = np.linspace(-2, 2, 100)
    weights = np.zeros((len(PARAMETERS) + 1, 1))
    weights[height] = -1.5
    counts = TrialCounts((0,), (0,), (1,), False, ())
    inference = inferred(swept, counts, scores, 0.5, Emulator((((weights, np.zeros(1)),),)))

    ranked = rank_next_trials(inference, swept)

    assert [one.bits for one in ranked] == sorted((one.bits for one in ranked), reverse=True)
    for one in ranked:
        # The value that runs would have: the drawn one times the height.
        values = np.array([draw["obstacle_height"] for draw in values_of(scores)]) * one.height
        logits = -1.5 * np.log(values) / 0.2
        done = (0, 1) if (one.design, one.height) == (0, 1.0) else (0, 0)
        assert one.bits == pytest.approx(bits_by_quadrature(logits, 0.5, done), abs=0.003)
    flat = rank_next_trials(inference, experiment({"kind": "patch", "friction": 0.3}))
    assert {one.height for one in flat} == {1.0}


def left_out_by_quadrature(counts: TrialCounts) -> list[float]:
    """The log score of each design's trials given the others', by plain sums over friction, τ and the discrepancies."""
    z, t, e = (np.linspace(-5, 5, number) for number in (81, 41, 81))
    tau = np.asarray(DISCREPANCY.value(t))
    weight = norm.pdf(e) / norm.pdf(e).sum()
    features = (np.array(WIDTHS) - np.mean(WIDTHS)) / np.std(WIDTHS)
    likelihoods = np.array([
        binom.pmf(k, n, expit(2 * z[:, None, None] + features[design] + tau[:, None] * e)) @ weight
        for design, k, n in zip(counts.designs, counts.passed, counts.counted, strict=True)
    ])  # fmt: skip
    prior = norm.pdf(z)[:, None] * norm.pdf(t)
    every = prior * likelihoods.prod(axis=0)
    others = [prior * np.delete(likelihoods, index, axis=0).prod(axis=0) for index in range(len(likelihoods))]
    return [float(np.log(every.sum() / one.sum())) for one in others]


def test_a_summary_has_the_numbers_of_its_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(emulator, "fit", lambda *_: linear(2.0, 1.0))
    simulator: Any = Formula(seed=7)
    counts = TrialCounts((0, 1, 3), (2, 0, 9), (10, 3, 10), False, ("a note",))
    known = {NAMES.index("track_m"): 0.5}
    inference = infer(simulator, counts, 1000, lambda runs: None, known)
    nominal = {0: (30, 100), 1: (0, 100), 3: (100, 100)}

    summary = summarise(inference, simulator.experiment, nominal, 7, 1000, True)

    posterior = inference.posterior
    shown = {one["name"]: one for one in summary["parameters"]}
    assert list(shown) == [*NAMES, "discrepancy"]
    for index, parameter in enumerate(PARAMETERS):
        values = np.sort([parameter.value(score) for score in posterior.scores[:, index]])
        one = shown[parameter.name]
        assert [one["posterior"][end] for end in ("low", "median", "high")] == pytest.approx(
            list(np.quantile(values, [0.05, 0.5, 0.95]))
        )
        if index in known:
            assert one["explained"] is None and one["posterior"]["low"] == pytest.approx(0.002)
            continue
        assert [one["prior"][end] for end in ("low", "median", "high")] == pytest.approx(
            [parameter.value(norm.ppf(part)) for part in (0.05, 0.5, 0.95)], rel=1e-5, abs=1e-12
        )
        assert one["explained"] == pytest.approx(max(0, 1 - np.var(posterior.scores[:, index])))
    assert shown["friction"]["explained"] > 0.3 > abs(shown["servo_speed"]["explained"])
    assert shown["discrepancy"]["posterior"]["median"] == pytest.approx(np.median(posterior.discrepancy))
    assert DISCREPANCY.value(0.0) == pytest.approx(shown["discrepancy"]["prior"]["median"])
    # Every pair of those that are inferred, by scipy's correlation, the strongest first.
    pairs = {frozenset(one["parameters"]): one["correlation"] for one in summary["correlations"]}
    assert len(pairs) == len(summary["correlations"]) == (len(NAMES) - 1) * (len(NAMES) - 2) // 2
    assert not any("track_m" in pair for pair in pairs)
    for first, second in (("friction", "servo_torque"), ("com_height_m", "wheel_spread")):
        columns = (posterior.scores[:, NAMES.index(name)] for name in (first, second))
        assert pairs[frozenset((first, second))] == pytest.approx(pearsonr(*columns).statistic, abs=6e-4)
    sizes = [abs(one["correlation"]) for one in summary["correlations"]]
    assert sizes == sorted(sizes, reverse=True)
    told = summary["log_likelihood"]
    trials = list(zip((2, 0, 9), (10, 3, 10), (30.5 / 101, 0.5 / 101, 100.5 / 101), strict=True))
    assert told["nominal"] == pytest.approx(sum(binom.logpmf(k, n, p) for k, n, p in trials))
    assert told["best"] == pytest.approx(sum(binom.logpmf(k, n, k / n) for k, n, _ in trials))
    assert told["expected"] == pytest.approx(posterior.log_likelihood.mean())
    for index, one in enumerate(summary["designs"]):
        rates = expit(inference.logits[:, index])
        assert one["design"] == {"width_mm": WIDTHS[counts.designs[index]]}
        assert (one["passed"], one["counted"]) == (counts.passed[index], counts.counted[index])
        assert one["nominal"] == (0.3, 0.0, 1.0)[index]
        assert [one["simulated"][end] for end in ("low", "median", "high")] == pytest.approx(
            list(np.quantile(rates, [0.05, 0.5, 0.95]))
        )
        assert one["simulated"]["mean"] == pytest.approx(rates.mean())
        assert one["emulated"] == pytest.approx(rates[inference.chosen].mean())
        assert one["checked"] == inference.checked[index]
        # Another car: a share of whole trials, as probable as the binomial mixed over draws and discrepancies says.
        z = np.linspace(-6, 6, 31)
        weight = norm.pdf(z) / norm.pdf(z).sum()
        built = expit(inference.logits[::4, index][:, None] + posterior.discrepancy[::4, None] * z)
        chances = [(binom.pmf(k, counts.counted[index], built) @ weight).mean() for k in range(counts.counted[index] + 1)]
        shares = np.arange(counts.counted[index] + 1) / counts.counted[index]
        assert one["predicted"]["mean"] == pytest.approx(shares @ chances, abs=0.03)
        for kind, tail in (("predicted", 0.05), ("predicted_95", 0.025)):
            ends = [shares[np.searchsorted(np.cumsum(chances), part)] for part in (tail, 1 - tail)]
            assert [one[kind][end] for end in ("low", "high")] == pytest.approx(ends, abs=0.11)
    left = summary["leave_one_out"]
    assert [(one["passed"], one["counted"]) for one in left] == [(2, 10), (0, 3), (9, 10)]
    assert [one["nominal_log_score"] for one in left] == pytest.approx([binom.logpmf(k, n, p) for k, n, p in trials])
    assert [one["log_score"] for one in left] == pytest.approx(left_out_by_quadrature(counts), abs=0.12)
    assert summary["notes"] == ["a note"] and len(summary["next_trials"]) == 3


def told(name: str, explained: float | None, **posterior: float) -> dict[str, Any]:
    """A parameter of a summary."""
    prior = {"low": 0.7, "median": 1.0, "high": 1.5}
    return {"name": name, "unit": "×", "explained": explained, "prior": prior, "posterior": prior | posterior}


def test_findings_are_what_the_numbers_say() -> None:
    narrow, wide = {"low": 0.3, "high": 0.9}, {"low": 0.0, "high": 0.5}
    design = {"passed": 9, "counted": 10, "checked": 0.5, "emulated": 0.55}
    summary: dict[str, Any] = {
        "designs": [
            {**design, "design": {"width_mm": 65.0}, "predicted_95": narrow},
            {**design, "design": {"width_mm": 95.0}, "predicted_95": wide, "checked": 0.62, "emulated": 0.55},
        ],
        "parameters": [
            told("friction", 0.3, median=0.8123, low=0.7, high=0.9),
            told("obstacle_height", 0.72, median=1.1, low=0.95, high=1.3),
            told("servo_torque", 0.1),
            told("servo_speed", 0.09),
            told("wheel_spread", 0.0),
            told("track_m", None),
            told("discrepancy", None, median=1.31),
        ],
        "correlations": [
            {"parameters": ["friction", "obstacle_height"], "correlation": 0.5},
            {"parameters": ["com_height_m", "obstacle_height"], "correlation": -0.25},
            {"parameters": ["friction", "track_m"], "correlation": 0.249},
        ],
        "next_trials": [
            {"design": {"width_mm": 65.0}, "obstacle_height": 0.7, "trials": 10, "bits": 0.406, "parameter": "friction"},
            {"design": {"width_mm": 95.0}, "obstacle_height": 1.0, "trials": 10, "bits": 0.3, "parameter": "track_m"},
        ],
    }

    assert findings(summary) == [
        "The trials of 95 mm lie outside the 95 % intervals that the calibrated simulator predicts: no set of "
        "these parameters explains them.",
        "A discrepancy larger than assumed before is needed: the simulator lacks something that the cars have.",
        "obstacle_height is 1.1 (0.95 to 1.3) ×, before the trials 1 (0.7 to 1.5).",
        "friction is 0.812 (0.7 to 0.9) ×, before the trials 1 (0.7 to 1.5).",
        "The trials say next to nothing about servo_speed, wheel_spread: their intervals are those assumed before.",
        "The trials cannot tell friction and obstacle_height apart (correlation +0.50): lower friction with lower "
        "obstacle_height explains them as well.",
        "The trials cannot tell com_height_m and obstacle_height apart (correlation -0.25): lower com_height_m with "
        "higher obstacle_height explains them as well.",
        "Simulated under the calibration, 95 mm passes 62 %, the emulator said 55 %: take more --runs.",
        "Most would be learned by 10 trials of 65 mm with obstacles 70 % as high (0.41 bits, most about friction); "
        "of 95 mm (0.30 bits, most about track_m).",
    ]
    fits = {**summary, "designs": summary["designs"][:1], "parameters": [told("discrepancy", None, median=1.3)]}
    assert findings(fits)[0].startswith("The calibrated simulator's 95 % intervals cover the trials of all")
    assert not any("discrepancy" in one or "say next to nothing" in one for one in findings(fits))


def test_what_was_measured_is_a_score_within_what_the_emulator_has_seen() -> None:
    scores = known_scores({"friction": 1.0, "track_m": 0.008, "start_position_sd_m": 0.0, "servo_torque": 0.85})

    # In standard deviations from the prior's middle; no scatter at all is as low as may be.
    expected = {"friction": 0.0, "track_m": 2.0, "start_position_sd_m": -2.5, "servo_torque": 0.0}
    assert {NAMES[index]: score for index, score in scores.items()} == pytest.approx(expected)
    for name, end in (("friction", math.exp(0.3 * 2.5)), ("track_m", -0.004 * 2.5)):
        assert abs(next(iter(known_scores({name: end * (1 - 1e-9)}).values()))) == pytest.approx(2.5)
        with pytest.raises(FoldcarError, match=f"--known {name}: .* is outside"):
            known_scores({name: end * (1 + 1e-9)})
