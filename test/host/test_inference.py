"""A calibration by a simulator that is a formula: its scatter, and what further trials are expected to tell."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import binom, norm

from foldcar.calibration import bank
from foldcar.calibration.bank import OTHERS, features_of
from foldcar.calibration.emulator import Emulator
from foldcar.calibration.experiment import SweptDesign, SweptExperiment
from foldcar.calibration.inference import DRAWS, infer, plan
from foldcar.calibration.next_trials import HEIGHTS, TRIALS, rank_next_trials
from foldcar.calibration.parameters import NAMES, PARAMETERS, values_of
from foldcar.calibration.simulation import CalibrationRun
from foldcar.calibration.trial_counts import TrialCounts

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
    monkeypatch.setattr(bank, "fit", lambda *_: linear(2.0, 1.0))
    simulator: Any = Formula(seed=7)
    counts = TrialCounts((0, 3), (2, 9), (10, 10), False, ())
    told: list[int] = []

    found = infer(simulator, counts, 1000, told.append)

    planned = plan(1000, 2)
    sets = planned.first + planned.second
    learned, check = simulator.asked[: (2 + OTHERS) * sets], simulator.asked[(2 + OTHERS) * sets :]
    assert [run.number for run in learned] == [number for number in range(sets) for _ in range(2 + OTHERS)]
    assert [run.number for run in check] == [sets + n for n in range(DRAWS * planned.scenes) for _ in range(2)]
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
    posterior = SimpleNamespace(scores=scores, discrepancy=np.full(400, 0.7))
    # All designs alike, whatever the height: candidates differ by the trials done alone.
    inference: Any = SimpleNamespace(
        counts=counts, posterior=posterior, emulator=linear(1.0, 0.0), features=features_of(swept)
    )

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
    posterior = SimpleNamespace(scores=scores, discrepancy=np.full(100, 0.5))
    inference: Any = SimpleNamespace(
        counts=counts, posterior=posterior, emulator=Emulator((((weights, np.zeros(1)),),)), features=features_of(swept)
    )

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
