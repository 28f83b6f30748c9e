"""Calibrations with a formula in place of the simulator: scatter, rates, posterior."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import binom, norm

from foldcar.belief.priors import (
    NAMES,
    PARAMETERS,
    SHEETS_COM_HEIGHT,
    ScorePrior,
    built_priors,
)
from foldcar.inference.calibration import emulator
from foldcar.inference.calibration import inference as inference_module
from foldcar.inference.calibration.emulator import MAX_CELLS, OTHERS, Emulator, cell_inputs, prior_scores, simulate_bank
from foldcar.inference.calibration.experiment import CalibrationRun, SweptDesign, SweptExperiment
from foldcar.inference.calibration.inference import DRAWS, Inference, Problem, infer, plan
from foldcar.inference.calibration.observations import Cell, Observations
from foldcar.inference.calibration.posterior import DISCREPANCY, sample_posterior
from foldcar.inference.calibration.predictions import rates_of
from foldcar.inference.calibration.summary import summarise

SCENES = 30
RUNS = 2700
WIDTHS = (65.0, 95.0, 115.0, 180.0)
FRICTION = NAMES.index("friction")


@pytest.fixture(scope="module", autouse=True)
def quick() -> Iterator[None]:
    """One network that learns for a tenth of the time, and fewer draws: what is tried does not depend on them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(emulator, "NETWORKS", 1)
        patch.setattr(emulator, "STEPS", 600)
        patch.setattr(inference_module, "sample_posterior", partial(sample_posterior, particles=300))
        yield


def experiment(*terrain: dict[str, Any]) -> SweptExperiment:
    """Four widths in scenes with these pieces of terrain."""
    info: Any = SimpleNamespace(varied=["width_mm"], id="1")
    designs = tuple(SweptDesign({"width_mm": width}, {}, "{}") for width in WIDTHS)
    return SweptExperiment(info, designs, ({"terrain": list(terrain)},) * SCENES)


class Logistic:
    """In place of a network: the success logit is a weighted sum of the inputs."""

    def __init__(self, weights: np.ndarray[Any, Any]) -> None:
        self.weights = weights

    def predict_proba(self, rows: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return probabilities (n, 2) of failing and passing."""
        rate = expit(rows @ self.weights)
        return np.column_stack([1 - rate, rate])


def linear(width: float, car_sd: float = 0.0, **weights: float) -> Emulator:
    """Return the emulator whose logit is a sum of scores times ``weights`` and the design's input times ``width``."""
    row = np.zeros(len(PARAMETERS) + 1)
    row[[*map(NAMES.index, weights), -1]] = [*weights.values(), width]
    return Emulator((Logistic(row),), 1, car_sd)


def observations(*cars: tuple[int, int, int]) -> Observations:
    """Return trials of cars: each its design, and numbers of passed and of all trials."""
    car = np.repeat(np.arange(len(cars)), [counted for _, _, counted in cars])
    passed = [float(i < k) for _, k, n in cars for i in range(n)]
    designs = np.array([design for design, _, _ in cars])
    cells = tuple(Cell(int(design), None) for design in dict.fromkeys(designs.tolist()))
    cell = np.array([[cell.design for cell in cells].index(design) for design in designs[car]])
    return Observations(cells, cell, car, designs, np.array(passed), False, ())


def problem(swept: SweptExperiment, observed: Observations, emulated: Emulator) -> Problem:
    """The problem of these trials with an emulator."""
    return Problem(observed, emulated, cell_inputs(swept, observed.cells)[0], {})


class Formula:
    """In place of carsim: success rises with friction and width; each car has an offset of its own. Keeps all runs."""

    def __init__(self, seed: int, car_sd: float = 0.0) -> None:
        self.experiment, self.seed, self.car_sd = experiment(), seed, car_sd
        self.runs: list[CalibrationRun] = []

    def passes(self, runs: Iterable[CalibrationRun], done: Any) -> np.ndarray[Any, Any]:
        """Return whether each run passed."""
        runs = list(runs)
        self.runs += runs
        done(len(runs))
        passed = []
        for run in runs:
            offset = self.car_sd * np.random.default_rng([1, run.car]).standard_normal()
            logit = 2 * np.log(run.values["friction"]) / 0.3 + run.design - 1.5 + offset
            passed.append(float(np.random.default_rng([3, run.number]).random() < expit(logit)))
        return np.array(passed)


@pytest.mark.parametrize("car_sd", [0.0, 1.0])
def test_the_bank_shows_how_much_of_the_scatter_is_the_cars(car_sd: float) -> None:
    simulator: Any = Formula(7, car_sd)
    cells = tuple(Cell(2, {"terrain": [], "k": k}) for k in range(6))
    observed = replace(observations((2, 5, 6)), cells=cells, cell=np.arange(6))
    bank = simulate_bank(simulator, prior_scores(500, 1), observed, 0, lambda runs: None)
    inputs, width = cell_inputs(simulator.experiment, observed.cells)

    emulated = bank.emulator(inputs, width, 1)

    assert len(bank.scores) == 500 * (6 + OTHERS) and MAX_CELLS > 6
    assert emulated.car_sd == pytest.approx(car_sd, abs=0.4)


def test_trials_that_say_nothing_leave_the_prior_of_the_sheets() -> None:
    """The posterior of the centre of mass, where no run depends on it, is its prior of these cars: 0 ± 3 mm."""
    swept = experiment({"kind": "pothole", "depth_m": 0.03})
    column = NAMES.index("com_height_m")
    simulator: Any = Formula(seed=7)
    observed = observations((0, 2, 10), (3, 3, 4))
    sheets = built_priors("W_B_W", True)
    everything = dict.fromkeys(range(len(PARAMETERS)), ScorePrior(0.0, 0.0, "measured")) | sheets
    one = replace(problem(swept, observed, linear(0.0)), priors=sheets)

    values = PARAMETERS[column].value(one.posterior(1).scores[:, column])
    found = infer(simulator, observed, RUNS, priors=everything)
    summary = summarise(found, swept, {}, 7, RUNS, False)

    assert values.mean() == pytest.approx(0, abs=0.0006) and values.std() == pytest.approx(0.003, rel=0.15)
    shown = next(row for row in summary["parameters"] if row["name"] == "com_height_m")
    ends = [shown["prior"][end] for end in ("low", "median", "high")]
    assert ends == pytest.approx([-1.645 * 0.003, 0, 1.645 * 0.003], abs=1e-6)
    assert shown["explained"] < 0.3 and shown["source"] == SHEETS_COM_HEIGHT.source
    # Only one parameter was not measured, so there are no pairs.
    assert summary["correlations"] == []


def test_named_cells_narrow_what_stands_for_the_supply() -> None:
    assert built_priors("W_B_W", False) == {}

    priors = built_priors("W_B_W+cells=nimh", False)

    assert [NAMES[index] for index in priors] == ["servo_torque", "servo_speed"]
    for (index, prior), middle, sd in zip(priors.items(), (0.95, 1.0), (0.28, 0.12), strict=True):
        z = np.random.default_rng(1).standard_normal(20_000)
        logs = np.log(PARAMETERS[index].value(prior.mean + prior.sd * z))
        assert np.exp(logs.mean()) == pytest.approx(middle, rel=0.01) and logs.std() == pytest.approx(sd, rel=0.02)


class Inferred(NamedTuple):
    """An inference, the runs that it simulated, and the number of runs it reported as finished."""

    result: Inference
    runs: list[CalibrationRun]
    finished: int


@pytest.fixture(scope="module")
def inferred_once() -> Inferred:
    """By the formula, from trials of three designs, with a track that was measured."""
    simulator: Any = Formula(seed=7)
    observed = replace(observations((0, 2, 10), (1, 0, 3), (3, 5, 6), (3, 4, 4)), notes=("a note",))
    finished: list[int] = []
    priors = {NAMES.index("track_m"): ScorePrior(0.5, 0.0, "measured")}
    result = infer(simulator, observed, RUNS, finished.append, priors)
    return Inferred(result, simulator.runs, sum(finished))


def test_sets_have_scatter_of_their_own_and_one_car_for_all_its_drives(inferred_once: Inferred) -> None:
    """The check, too: it would otherwise repeat the accidents of the runs that the emulator has learned."""
    result, runs, finished = inferred_once
    observed = result.problem.observed

    for number in (RUNS, 24_000):
        assert plan(number, observed, 4).runs == pytest.approx(number, rel=0.25)
    assert finished == len(runs) <= plan(RUNS, observed, 4).runs
    check = result.table.size
    learned, checked = runs[:-check], runs[-check:]
    # No two drives scatter alike; one number of a car has one design or is of another design's car with the same values.
    numbers = [run.number for run in learned]
    assert len(set(numbers)) == len(numbers) and not set(numbers) & {run.number for run in checked}
    of_car: dict[int, set[Any]] = {}
    for run in learned:
        of_car.setdefault(run.car, set()).add((run.design, tuple(run.values.items())))
    assert all(len(one) == 1 for one in of_car.values())
    # Each set with the designs that have trials, then with others, any of the family.
    sets = [[run.design for run in learned[i : i + 3 + OTHERS]] for i in range(0, len(learned), 3 + OTHERS)]
    assert all(designs[:3] == [0, 1, 3] for designs in sets)
    assert {design for designs in sets for design in designs[3:]} == set(range(len(WIDTHS)))
    # The check has the designs with each of the published draws, as often.
    assert result.designs.tolist() == [0, 1, 2, 3] and result.table.shape == (check // 4, 4)
    assert [dict(run.values) for run in checked[:: check // DRAWS]] == result.draws


def test_a_summary_has_the_numbers_of_its_draws(inferred_once: Inferred) -> None:
    inference, nominal = inferred_once.result, {0: (30, 100), 1: (0, 100), 3: (100, 100)}

    summary = summarise(inference, experiment(), nominal, 7, RUNS, True)

    posterior = inference.posterior
    shown = {one["name"]: one for one in summary["parameters"]}
    assert list(shown) == [*NAMES, "discrepancy"]
    for index, parameter in enumerate(PARAMETERS):
        values = np.sort([parameter.value(score) for score in posterior.scores[:, index]])
        one = shown[parameter.name]
        assert [one["posterior"][end] for end in ("low", "median", "high")] == pytest.approx(
            list(np.quantile(values, [0.05, 0.5, 0.95]))
        )
        if parameter.name == "track_m":
            assert one["explained"] is None and one["posterior"]["low"] == pytest.approx(0.002)
        else:
            assert one["explained"] == pytest.approx(max(0, 1 - np.var(posterior.scores[:, index])))
    designs = summary["designs"]
    assert [(design["passed"], design["counted"]) for design in designs] == [(2, 10), (0, 3), (0, 0), (9, 10)]
    assert "predicted" not in designs[2] and designs[2]["nominal"] is None
    for one, rate in zip(designs, inference.table.mean(axis=0), strict=True):
        # The calibrated rate is the simulated share, smoothed over designs.
        assert one["simulated"]["mean"] == pytest.approx(rate, abs=0.05)
    likelihood = summary["log_likelihood"]
    best = sum(binom.logpmf(k, n, k / n) for k, n in ((2, 10), (0, 3), (9, 10)))
    assert likelihood["best"] == pytest.approx(best) and likelihood["best"] >= likelihood["draws"]
    nominal_score = sum(binom.logpmf(k, n, (p + 0.5) / 101) for k, n, p in ((2, 10, 30), (0, 3, 0), (9, 10, 100)))
    assert likelihood["nominal"] == pytest.approx(nominal_score)
    assert summary["notes"] == ["a note"]
    # Each design's trials given the others' are told no better than given all.
    assert len(summary["leave_one_out"]) == 3
    for left, one in zip(summary["leave_one_out"], (designs[0], designs[1], designs[3]), strict=True):
        assert left["predicted"]["high"] - left["predicted"]["low"] >= one["predicted"]["high"] - one["predicted"]["low"]


def test_rates_are_as_uncertain_as_the_runs_that_counted_them(inferred_once: Inferred) -> None:
    """Against the binomial error of log-odds: 1 / (n p (1 - p))."""
    many = inferred_once.result
    certain = replace(many.posterior, scores=np.zeros((4000, len(PARAMETERS))), discrepancy=np.zeros(4000))
    table = np.random.default_rng(1).random((400, len(WIDTHS))) < [0.3, 0.4, 0.5, 0.6]

    few = rates_of(replace(many, posterior=certain, table=table.astype(float)), experiment(), 1)

    spread = np.log(few.calibrated / (1 - few.calibrated)).std(axis=0)
    assert spread == pytest.approx(np.sqrt(few.variances), rel=0.1)
    assert spread == pytest.approx(1 / np.sqrt(400 * few.simulated * (1 - few.simulated)), rel=0.25)
    assert few.calibrated == pytest.approx(few.predicted, abs=1e-3)


def test_the_formulas_rates_are_found(inferred_once: Inferred) -> None:
    """2 of 10, 0 of 3 and 9 of 10 with logits that rise by 1 a design: the posterior of friction, by plain sums."""
    z = np.linspace(-5, 5, 1001)
    logits = 2 * z[:, None] + np.array([-1.5, -0.5, 1.5])
    weights = norm.pdf(z) * np.prod(binom.pmf([2, 0, 9], [10, 3, 10], expit(logits)), axis=1)
    mean = (weights * z).sum() / weights.sum()

    # The discrepancy and the emulator, which learned from single runs, allow for a difference.
    score = inferred_once.result.posterior.scores[:, FRICTION].mean()
    assert score == pytest.approx(mean, abs=0.25)


def test_the_posterior_is_that_of_rejection(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw the model of two cars two million times and keep the draws that pass as often as observed (ABC)."""
    swept, emulated = experiment(), linear(1.0, car_sd=0.4, friction=2.0)
    observed = observations((0, 2, 10), (3, 4, 4))
    one = problem(swept, observed, emulated)
    monkeypatch.setattr(inference_module, "sample_posterior", partial(sample_posterior, particles=2000))

    posterior = one.posterior(1)

    stream, draws = np.random.default_rng(5), 2_000_000
    z = stream.standard_normal(draws)
    tau = abs(stream.normal(0, DISCREPANCY.sd, draws))
    shared = np.linalg.cholesky(one.correlation[observed.car_design])
    offsets = tau[:, None] * (stream.standard_normal((draws, 2)) @ shared.T)
    offsets += emulated.car_sd * stream.standard_normal((draws, 2))
    nominal = emulated.logits(np.zeros((1, len(PARAMETERS))), one.inputs[:2])
    logits = emulated.centre_factor * (2 * z[:, None] + nominal)
    kept = (stream.binomial([10, 4], expit(logits + offsets)) == [2, 4]).all(axis=1)
    assert kept.sum() > 3000
    scores = posterior.scores[:, FRICTION]
    assert scores.mean() == pytest.approx(z[kept].mean(), abs=0.1)
    assert scores.std() == pytest.approx(z[kept].std(), rel=0.1)
    assert posterior.discrepancy.mean() == pytest.approx(tau[kept].mean(), rel=0.1)
