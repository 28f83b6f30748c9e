"""A calibration by a simulator that is a formula: its scatter, its rates, what further trials are expected to tell."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.special import expit, log_expit
from scipy.stats import binom, norm

from foldcar.inference.calibration import emulator
from foldcar.inference.calibration import inference as inference_module
from foldcar.inference.calibration.drive_features import FEATURES, PITCH, TIME, possible_ends
from foldcar.inference.calibration.emulator import MOST_CELLS, OTHERS, Emulator, cell_inputs, prior_scores, simulate_bank
from foldcar.inference.calibration.experiment import CalibrationRun, SimulatedDrive, SweptDesign, SweptExperiment
from foldcar.inference.calibration.inference import ALONE, DRAWS, Inference, Problem, infer, plan
from foldcar.inference.calibration.observations import Cell, Observations
from foldcar.inference.calibration.parameters import (
    NAMES,
    PARAMETERS,
    SHEETS_COM_HEIGHT,
    ScorePrior,
    built_priors,
    values_of,
)
from foldcar.inference.calibration.posterior import DISCREPANCY, PATH_DISCREPANCY, Posterior, sample_posterior
from foldcar.inference.calibration.predictions import HEIGHTS, TRIALS, rank_next_trials, rates_of
from foldcar.inference.calibration.summary import summarise

SCENES = 30
RUNS = 2700
WIDTHS = (65.0, 95.0, 115.0, 180.0)
FRICTION, SPEED = NAMES.index("friction"), NAMES.index("servo_speed")


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


class Logit:
    """In place of a network: the logit of not passing is a sum of weighted inputs."""

    classes_ = np.arange(2)

    def __init__(self, weights: np.ndarray[Any, Any]) -> None:
        self.weights = weights

    def predict_log_proba(self, rows: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Log probabilities of passing and of the first way to fail."""
        logits = rows @ self.weights
        return log_expit(np.column_stack([-logits, logits]))


def linear(width: float, **weights: float) -> Emulator:
    """The emulator whose logit is a sum of scores times their ``weights`` and the design's input times ``width``."""
    row = np.zeros(len(PARAMETERS) + 1)
    row[[*map(NAMES.index, weights), -1]] = [*weights.values(), width]
    unknown = np.full((FEATURES, FEATURES), np.nan)
    terms = (1 + len(PARAMETERS) * (len(PARAMETERS) + 3) // 2) * 4
    return Emulator((Logit(-row),), 1, np.zeros((terms, FEATURES)), unknown[:2], unknown, unknown[0], 0.0)


def observations(*cars: tuple[int, int, int], scene: Any = None) -> Observations:
    """Trials of cars: each its design, and how many of how many trials passed."""
    car = np.repeat(np.arange(len(cars)), [counted for _, _, counted in cars])
    ends = [possible_ends("passed" if i < k else "not_passed") for _, k, n in cars for i in range(n)]
    designs = np.array([design for design, _, _ in cars])
    cells = tuple(Cell(int(design), scene) for design in dict.fromkeys(designs.tolist()))
    unknown = np.full((len(car), FEATURES), np.nan)
    cell = np.array([[cell_.design for cell_ in cells].index(design) for design in designs[car]])
    return Observations(cells, cell, car, designs, np.array(ends), unknown, 0 * unknown, False, ())


def problem(swept: SweptExperiment, observed: Observations, emulated: Emulator) -> Problem:
    """The problem of these trials with an emulator."""
    return Problem(observed, emulated, cell_inputs(swept, observed.cells)[0], {})


class Formula:
    """In place of carsim: more friction and width pass more often, faster servos sooner. Keeps what was asked of it."""

    def __init__(self, seed: int) -> None:
        self.experiment, self.seed = experiment(), seed
        self.simulated_runs: list[CalibrationRun] = []

    def drives(self, runs: Iterable[CalibrationRun], done: Any) -> list[SimulatedDrive | None]:
        """Whether each passed, by chance, and its time, to which each car has a part of its own."""
        values = list(runs)
        self.simulated_runs += values
        done(len(values))
        drives: list[SimulatedDrive | None] = []
        for run in values:
            own, scatter = (np.random.default_rng(n).standard_normal() for n in ([1, run.car], [2, run.number]))
            logit = 2 * np.log(run.values["friction"]) / 0.3 + run.design - 1.5
            features = np.full(FEATURES, np.nan)
            features[PITCH] = scatter
            passed = np.random.default_rng([3, run.number]).random() < expit(logit)
            if passed:
                features[TIME] = -np.log(run.values["servo_speed"]) + 0.06 * own + 0.08 * scatter
            drives.append(SimulatedDrive(0 if passed else 1, features))
        return drives


def test_the_bank_tells_what_of_the_scatter_is_the_cars() -> None:
    simulator: Any = Formula(seed=7)
    cells = tuple(Cell(3, {"terrain": [], "k": k}) for k in range(6))
    observed = replace(observations((3, 5, 6)), cells=cells, cell=np.arange(6))
    bank = simulate_bank(simulator, prior_scores(500, 1), observed, 0, lambda runs: None)
    inputs, width = cell_inputs(simulator.experiment, observed.cells)

    emulator_ = bank.emulator(inputs, width, 1)

    assert len(bank.scores) == 500 * (6 + OTHERS) and MOST_CELLS > 6
    assert math.sqrt(emulator_.covariance[TIME, TIME]) == pytest.approx(0.1, rel=0.08)
    # Given pitch, which is the drive's scatter itself, nothing but the car's part is left.
    assert emulator_.shares[TIME] == pytest.approx(0.95, abs=0.06) and emulator_.shares[PITCH] < 0.05
    assert emulator_.car_sd < 0.35
    fast = np.zeros((1, len(PARAMETERS)))
    fast[0, SPEED] = 1.0
    time = emulator_.feature_means(fast, inputs[:1])[0, 0, TIME]
    assert time == pytest.approx(-math.log(PARAMETERS[SPEED].value(1.0)), abs=0.01)


def bits_by_quadrature(logits: np.ndarray[Any, Any], means: Any, variance: Any) -> float:
    """Information of the next TRIALS of a car with these logits, all equally likely, by plain sums over its offset."""
    z = np.linspace(-6, 6, 241)
    weights = norm.pdf(z) / norm.pdf(z).sum()
    table = np.array([
        binom.pmf(np.arange(TRIALS + 1)[:, None], TRIALS, expit(logit + mean + math.sqrt(spread) * z)) @ weights
        for logit, mean, spread in zip(logits, means, variance, strict=True)
    ])  # fmt: skip
    together = table.mean(axis=0)
    return float((table * np.log2(table / together)).sum(axis=1).mean())


def inferred(case: Problem, scores: Any, tau: float) -> Any:
    """An inference with these draws of the scores and one discrepancy's sd."""
    unknown = np.zeros(len(scores))
    posterior = Posterior(scores, np.full(len(scores), tau), unknown, unknown)
    return SimpleNamespace(problem=case, posterior=posterior)


def test_what_further_trials_tell_is_the_information_of_their_count() -> None:
    """Lower obstacles are a lower value of their parameter; a car of a driven design shares its discrepancy."""
    swept = experiment({"kind": "pothole", "depth_m": 0.03})
    height = NAMES.index("obstacle_height")
    scores = np.zeros((100, len(PARAMETERS)))
    scores[:, height] = np.random.default_rng(1).permutation(np.linspace(-2, 2, 100))
    case = problem(swept, observations((0, 0, 3)), linear(0.0, obstacle_height=-1.5))

    ranked = rank_next_trials(inferred(case, scores, 0.5), swept)

    assert {(entry.design, entry.height) for entry in ranked} == {(d, h) for d in range(4) for h in HEIGHTS}
    assert [entry.bits for entry in ranked] == sorted((entry.bits for entry in ranked), reverse=True)
    means, variances = case.offsets(scores, np.full(100, 0.5), np.arange(4))
    for entry in ranked:
        # The value that runs would have: the drawn one times the height.
        values = np.array([draw["obstacle_height"] for draw in values_of(scores)]) * entry.height
        offset = means[:, entry.design], variances[:, entry.design]
        assert entry.bits == pytest.approx(bits_by_quadrature(-1.5 * np.log(values) / 0.2, *offset), abs=0.003)
        assert entry.parameter == "obstacle_height"
    flat = rank_next_trials(inferred(case, scores, 0.5), experiment({"kind": "patch", "friction": 0.3}))
    assert {entry.height for entry in flat} == {1.0}


def test_trials_that_say_nothing_leave_the_prior_of_the_sheets() -> None:
    """The posterior of the centre of mass, where no run depends on it, is its prior of these cars: 0 ± 3 mm."""
    swept = experiment({"kind": "pothole", "depth_m": 0.03})
    column = NAMES.index("com_height_m")
    simulator: Any = Formula(seed=7)
    observed = observations((0, 2, 10), (3, 3, 4))
    sheets = built_priors("W_B_W", True)
    everything = dict.fromkeys(range(len(PARAMETERS)), ScorePrior(0.0, 0.0, "measured")) | sheets
    case = replace(problem(swept, observed, linear(0.0)), priors=sheets)

    values = PARAMETERS[column].value(case.posterior(1).scores[:, column])
    inference = infer(simulator, observed, RUNS, priors=everything)
    summary = summarise(inference, swept, {}, 7, RUNS, False)

    assert values.mean() == pytest.approx(0, abs=0.0006) and values.std() == pytest.approx(0.003, rel=0.15)
    shown = next(row for row in summary["parameters"] if row["name"] == "com_height_m")
    ends = [shown["prior"][end] for end in ("low", "median", "high")]
    assert ends == pytest.approx([-1.645 * 0.003, 0, 1.645 * 0.003], abs=1e-6)
    assert shown["explained"] < 0.3 and shown["source"] == SHEETS_COM_HEIGHT.source
    # Of one parameter that was not measured there are no pairs, and trials tell most about it.
    assert summary["correlations"] == []
    assert {row["parameter"] for row in summary["next_trials"]} == {"com_height_m"}
    measured = replace(inference, problem=replace(inference.problem, priors=dict.fromkeys(everything, everything[0])))
    assert {row.parameter for row in rank_next_trials(measured, swept)} == {"discrepancy"}


def test_named_cells_narrow_what_stands_for_the_supply() -> None:
    assert built_priors("W_B_W", False) == {}

    priors = built_priors("W_B_W+cells=nimh", False)

    assert [NAMES[index] for index in priors] == ["servo_torque", "servo_speed"]
    for (index, prior), middle, sd in zip(priors.items(), (0.95, 1.0), (0.28, 0.12), strict=True):
        z = np.random.default_rng(1).standard_normal(20_000)
        logs = np.log(PARAMETERS[index].value(prior.mean + prior.sd * z))
        assert np.exp(logs.mean()) == pytest.approx(middle, rel=0.01) and logs.std() == pytest.approx(sd, rel=0.02)


class Inferred(NamedTuple):
    """An inference, the runs that it simulated, and the number that it reported as done."""

    inference: Inference
    simulated_runs: list[CalibrationRun]
    reported: int


@pytest.fixture(scope="module")
def inferred_once() -> Inferred:
    """By the formula, from trials of three designs, with a track that was measured."""
    simulator: Any = Formula(seed=7)
    observed = replace(observations((0, 2, 10), (1, 0, 3), (3, 5, 6), (3, 4, 4)), notes=("a note",))
    progress: list[int] = []
    result = infer(simulator, observed, RUNS, progress.append, {NAMES.index("track_m"): ScorePrior(0.5, 0.0, "measured")})
    return Inferred(result, simulator.simulated_runs, sum(progress))


def test_sets_have_scatter_of_their_own_and_one_car_for_all_its_drives(inferred_once: Inferred) -> None:
    """The check, too: it would otherwise repeat the accidents of the runs that the emulator has learned."""
    inference, simulated_runs, reported = inferred_once
    observed = inference.problem.observed

    for runs in (RUNS, 24_000):
        assert plan(runs, observed, 4).runs == pytest.approx(runs, rel=0.25)
    assert reported == len(simulated_runs) <= plan(RUNS, observed, 4).runs
    check = inference.table.size
    learned, checked = simulated_runs[:-check], simulated_runs[-check:]
    # No two drives scatter alike; one number of a car has one design or is of another design's car with the same values.
    numbers = [run.number for run in learned]
    assert len(set(numbers)) == len(numbers) and not set(numbers) & {run.number for run in checked}
    of_car: dict[int, set[Any]] = {}
    for run in learned:
        of_car.setdefault(run.car, set()).add((run.design, tuple(run.values.items())))
    assert all(len(cars) == 1 for cars in of_car.values())
    # Each set with the designs that have trials, then with others, any of the family.
    sets = [[run.design for run in learned[i : i + 3 + OTHERS]] for i in range(0, len(learned), 3 + OTHERS)]
    assert all(designs[:3] == [0, 1, 3] for designs in sets)
    assert {design for designs in sets for design in designs[3:]} == set(range(len(WIDTHS)))
    # The check has the designs with each of the published draws, as often.
    assert inference.designs.tolist() == [0, 1, 2, 3] and inference.table.shape == (check // 4, 4)
    assert [dict(run.values) for run in checked[:: check // DRAWS]] == inference.draws


def test_a_summary_has_the_numbers_of_its_draws(inferred_once: Inferred) -> None:
    inference, nominal = inferred_once.inference, {0: (30, 100), 1: (0, 100), 3: (100, 100)}

    summary = summarise(inference, experiment(), nominal, 7, RUNS, True)

    posterior = inference.posterior
    shown = {row["name"]: row for row in summary["parameters"]}
    assert list(shown) == [*NAMES, "discrepancy"]
    for index, parameter in enumerate(PARAMETERS):
        values = np.sort([parameter.value(score) for score in posterior.scores[:, index]])
        design = shown[parameter.name]
        assert [design["posterior"][end] for end in ("low", "median", "high")] == pytest.approx(
            list(np.quantile(values, [0.05, 0.5, 0.95]))
        )
        if parameter.name == "track_m":
            assert design["explained"] is None and design["posterior"]["low"] == pytest.approx(0.002)
        else:
            assert design["explained"] == pytest.approx(max(0, 1 - np.var(posterior.scores[:, index])))
    designs = summary["designs"]
    assert [(design["passed"], design["counted"]) for design in designs] == [(2, 10), (0, 3), (0, 0), (9, 10)]
    assert "predicted" not in designs[2] and designs[2]["nominal"] is None
    for design, rate in zip(designs, inference.table.mean(axis=0), strict=True):
        # The calibrated rate is the simulated share, smoothed over designs.
        assert design["simulated"]["mean"] == pytest.approx(rate, abs=0.05)
    likelihood = summary["log_likelihood"]
    best = sum(binom.logpmf(k, n, k / n) for k, n in ((2, 10), (0, 3), (9, 10)))
    assert likelihood["best"] == pytest.approx(best) and likelihood["best"] >= likelihood["draws"]
    nominal_score = sum(binom.logpmf(k, n, (p + 0.5) / 101) for k, n, p in ((2, 10, 30), (0, 3, 0), (9, 10, 100)))
    assert likelihood["nominal"] == pytest.approx(nominal_score)
    assert summary["notes"] == ["a note"] and summary["misfits"] == []
    # Each design's trials given the others' are told no better than given all.
    assert len(summary["leave_one_out"]) == 3
    for left, design in zip(summary["leave_one_out"], (designs[0], designs[1], designs[3]), strict=True):
        assert (
            left["predicted"]["high"] - left["predicted"]["low"]
            >= design["predicted"]["high"] - design["predicted"]["low"]
        )


def test_rates_are_as_uncertain_as_the_runs_that_counted_them(inferred_once: Inferred) -> None:
    """Against the binomial error of log-odds: 1 / (n p (1 - p))."""
    many = inferred_once.inference
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

    # A discrepancy is allowed for, and the emulator learned by single runs.
    friction = inferred_once.inference.posterior.scores[:, FRICTION].mean()
    assert friction == pytest.approx(mean, abs=0.25)


def test_the_posterior_is_that_of_rejection(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cars' outcomes and times: the model drawn two million times, kept where all comes out as observed (ABC)."""
    swept, cars = experiment(), ((0, 2, 10), (3, 4, 4))
    emulated, car_share, sd = linear(1.0, friction=2.0), 0.36, 0.1
    coefficients, covariance = emulated.coefficients.copy(), emulated.covariance.copy()
    middle = PARAMETERS[SPEED]
    coefficients[0, TIME], coefficients[4 * (1 + SPEED), TIME] = -math.log(middle.middle), -middle.sd
    covariance[TIME, TIME] = sd**2
    shares = np.where(np.arange(FEATURES) == TIME, car_share, np.nan)
    bounds = np.array([[-1.0], [1.0]]) * np.ones(FEATURES)
    emulated = replace(
        emulated, coefficients=coefficients, covariance=covariance, shares=shares, bounds=bounds, car_sd=0.4
    )
    observed = observations(*cars)
    features = observed.features.copy()
    times = {0: [-0.1, 0.0], 3: [-0.35, -0.25, -0.15, -0.25]}
    for car, (design, _, _) in enumerate(cars):
        passed = np.flatnonzero((observed.car == car) & (observed.passed > 0))
        features[passed, TIME] = times[design]
    observed = replace(observed, features=features, errors=np.zeros_like(features))
    case = problem(swept, observed, emulated)

    monkeypatch.setattr(inference_module, "sample_posterior", partial(sample_posterior, particles=2000))
    monkeypatch.setattr(inference_module, "MOST_TRIALS", 1e9)
    posterior = case.posterior(1)

    stream, draws = np.random.default_rng(5), 2_000_000
    z = stream.standard_normal((draws, 2))
    tau, kappa = (abs(stream.normal(0, prior.sd, draws)) for prior in (DISCREPANCY, PATH_DISCREPANCY))
    both = np.linalg.cholesky(case.alike)
    offsets = tau[:, None] * (stream.standard_normal((draws, 2)) @ both.T)
    offsets += emulated.car_sd * stream.standard_normal((draws, 2))
    logits = emulated.middle * (2 * z[:, :1] + emulated.logits(np.zeros((1, len(PARAMETERS))), case.inputs[:2]))
    passes = stream.binomial([10, 4], expit(logits + offsets))
    kept = (passes == [2, 4]).all(axis=1)
    z, kappa, draws = z[kept], kappa[kept], int(kept.sum())
    kept = np.ones(draws, dtype=bool)
    shared = stream.standard_normal((draws, 2)) @ both.T
    own = stream.standard_normal((draws, 2))
    for car, design in enumerate(times):
        number = len(times[design])
        rest = math.sqrt(1 - car_share) * stream.standard_normal((draws, number))
        rest += kappa[:, None] * math.sqrt(ALONE) * stream.standard_normal((draws, number))
        mean = rest.mean(axis=1) + math.sqrt(car_share) * own[:, car] + kappa * math.sqrt(1 - ALONE) * shared[:, car]
        mean = sd * mean - np.log(middle.value(z[:, 1]))
        kept &= abs(mean - np.mean(times[design])) < 0.06
        # The spread of one car's times tells of the discrepancy.
        kept &= abs(sd * rest.std(axis=1) - np.std(times[design])) < 0.03
    assert kept.sum() > 300
    for column, parameter in enumerate((FRICTION, SPEED)):
        exact, scores = z[kept, column], posterior.scores[:, parameter]
        assert scores.mean() == pytest.approx(exact.mean(), abs=0.15)
        assert scores.std() == pytest.approx(exact.std(), rel=0.15)
