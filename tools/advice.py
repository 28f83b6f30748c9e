"""Regret and coverage of the advice on realities that it does not know; docs/belief.md quotes the tables.

Simulates the width study in steps of 15 mm with its runs in other realities. Then it simulates the same cars in six
hidden realities, 120 runs a design. Cars of a design differ by 1.0 in log-odds. Policies drive cars in a hidden reality
and recommend a design; the regret is the true rate of the best design minus that of the recommended one. For coverage,
four designs are driven, and the bands of the others are compared with the truth. Some truths are distorted so that no
reality produces them.

Usage: .venv/bin/python tools/advice.py FOLDER [--repetitions N] [--jobs N]. FOLDER keeps the simulations.
"""

import argparse
import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import json5
import numpy as np
from scipy.special import expit, logit
from threadpoolctl import threadpool_limits

from foldcar.api.sweeping import planned_sweep
from foldcar.belief.advice import steps
from foldcar.belief.answers import Answers, believe
from foldcar.belief.learning import SLOPE, Learned, NominalRuns, learn
from foldcar.belief.priors import MAX_SCORE, MEASURABLE, NAMES, NOMINAL_SCORES, PARAMETERS, ScorePrior
from foldcar.belief.trials import Trials
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.store.reader import Store
from foldcar.study.reality_runs import planned_reality_runs

ROOT = Path(__file__).resolve().parent.parent
# An ordinary workshop: every unknown has its prior's median. The last reality lies outside what the priors contain: the
# centre of mass is off centre, and the supply is weak.
ORDINARY = {parameter.name: float(parameter.value(0.0)) for parameter in PARAMETERS}
HIDDEN: dict[str, dict[str, float]] = {
    "as expected": {},
    "lower friction": {"friction": 0.65},
    "higher obstacles": {"obstacle_height": 1.2},
    "higher centre of mass": {"com_height_m": 0.025},
    "four differences": {"friction": 0.8, "servo_torque": 0.65, "obstacle_height": 1.1, "com_height_m": 0.02},
    "not in the list": {"com_x_m": -0.02, "supply_resistance_ohm": 0.5},
}
CAMBER_RAD = 0.15
RUNS, REALITY_RUNS, MARKS = 120, 8_000, (12, 24, 42)
CAR_SD = 1.0
# Trials of a car before the choice is made anew, and trials of each car where coverage is measured.
ROUND, CAR_TRIALS = 6, 3
# A band covers a truth that is at most this far outside: the truths are counted, too.
TOLERANCE = 0.02
Rates = np.ndarray[Any, np.dtype[np.float64]]


def simulated_rates(folder: Path, name: str, jobs: int, engine: str, values: dict[str, float]) -> tuple[Rates, Rates]:
    """Return numbers of passed and of all runs (designs,) in a reality; "nominal" has runs in other realities, too."""
    listing = folder / "width_15.json"
    study = json5.loads((ROOT / "scenarios" / "width_study.json").read_text(encoding="utf-8"))
    text = (
        json.dumps(study)
        .replace('"step": 5', '"step": 15')
        .replace("step_pyramids.scenic", str(ROOT / "scenarios/step_pyramids.scenic"))
    )
    listing.write_text(text, encoding="utf-8")
    file = folder / f"{name.replace(' ', '_')}.json"
    file.write_text(json.dumps(values), encoding="utf-8")
    nominal = name == "nominal"
    store = folder / f"{name.replace(' ', '_')}.db"
    planned_sweep(
        listing, store, "tools/advice.py", environments=100 if nominal else RUNS, engine=engine,
        reality=None if nominal else file, realities=REALITY_RUNS if nominal else 0,
    ).run(jobs)  # fmt: skip
    with Store.open(store) as reader:
        counts = reader.design_counts(reader.experiment_ids()[0])
        return np.array(counts.passed, float), np.array(counts.counted, float)


def learned_rate(folder: Path) -> tuple[Learned, Rates]:
    """Return the learned success rate, and the designs' parameters (designs, 1)."""
    with Store.open(folder / "nominal.db") as store:
        (experiment,) = store.experiment_ids()
        designs = np.array([[float(design["width_mm"])] for design in store.designs(experiment).values()])
        counts = store.design_counts(experiment)
        nominal = NominalRuns(NOMINAL_SCORES, np.array(counts.passed, float), np.array(counts.counted, float))
        info = store.info().experiments[experiment]
        runs = planned_reality_runs(store, experiment, info.variation_seed, info.environments)
        return learn(runs, designs, nominal), designs


def driven(random: np.random.Generator, rate: float, trials: int) -> int:
    """Return how many trials a new car of a design with this rate passes."""
    centre = logit(rate) * np.sqrt(1 + SLOPE * CAR_SD**2)
    return int(random.binomial(trials, expit(centre + CAR_SD * random.standard_normal())))


def advised(learned: Learned, designs: Rates, truth: Rates, random: np.random.Generator) -> dict[int, float]:
    """Drive ROUND trials of a car at a time where foldcar's steps gain most; return the regret after each of MARKS."""
    counts: list[tuple[int, int, int]] = []
    done, regrets = 0, {}
    for mark in MARKS:
        while done < mark:
            answers = believe(learned, designs, Trials.of_counts(counts), offsets=learned.design_offsets)
            design = next_design(answers, random)
            counts.append((design, driven(random, truth[design], min(ROUND, mark - done)), min(ROUND, mark - done)))
            done += counts[-1][2]
        regrets[mark] = (
            truth.max() - truth[believe(learned, designs, Trials.of_counts(counts), offsets=learned.design_offsets).best]
        )
    return regrets


def next_design(answers: Answers, random: np.random.Generator) -> int:
    """Return the design of the best step; if no step gains, a design by its chance to be the best."""
    best = max(steps(answers, 0.0, lambda _: 1.0, {}, ROUND), key=lambda step: step.gain * (step.kind == "build"))
    if best.kind == "build" and best.design is not None and best.gain > 0.002:
        return best.design
    return int(random.choice(len(answers.expected), p=answers.best_chances))


def gaussian_process(nominal: Rates, designs: Rates, truth: Rates, random: np.random.Generator) -> dict[int, float]:
    """A Gaussian process on the difference to simulation, one trial of a new car at a time by Thompson sampling."""
    unit = (designs[:, 0] - designs.min()) / np.ptp(designs)
    distance = np.sqrt(5) * np.abs(unit[:, None] - unit) / 0.3
    covariance = 4 * (1 + distance + distance**2 / 3) * np.exp(-distance) + 1
    passed, counted, regrets = np.zeros(len(unit)), np.zeros(len(unit)), {}

    def posterior() -> tuple[Rates, Rates]:
        at = counted > 0
        if not at.any():
            return logit(nominal), covariance
        difference = logit((passed[at] + 0.5) / (counted[at] + 1)) - logit(nominal[at])
        gain = covariance[:, at] @ np.linalg.inv(covariance[np.ix_(at, at)] + np.diag(CAR_SD + 4 / counted[at]))
        return logit(nominal) + gain @ difference, covariance - gain @ covariance[at]

    for trial in range(1, MARKS[-1] + 1):
        mean, spread = posterior()
        design = int(random.multivariate_normal(mean, spread + 1e-9 * np.eye(len(unit))).argmax())
        passed[design] += driven(random, truth[design], 1)
        counted[design] += 1
        if trial in MARKS:
            regrets[trial] = truth.max() - truth[posterior()[0].argmax()]
    return regrets


def nominal_best(nominal: Rates, truth: Rates) -> dict[int, float]:
    """The best design in simulation."""
    return dict.fromkeys(MARKS, float(truth.max() - truth[nominal.argmax()]))


def equal_trials(nominal: Rates, truth: Rates, random: np.random.Generator) -> dict[int, float]:
    """Equal numbers of trials of one car of five evenly spaced designs; the best of them, by simulation if tied."""
    designs = np.linspace(1, len(truth) - 2, 5).round().astype(int)
    regrets = {}
    for mark in MARKS:
        trials = np.full(5, mark // 5) + (np.arange(5) < mark % 5)
        rates = [
            driven(random, truth[design], int(n)) / n + 1e-3 * nominal[design]
            for design, n in zip(designs, trials, strict=True)
        ]
        regrets[mark] = truth.max() - truth[designs[int(np.argmax(rates))]]
    return regrets


def regret_table(
    learned: Learned, designs: Rates, nominal: Rates, truths: list[Rates], repetitions: int
) -> Iterator[str]:
    """Yield the table of regrets, in points with standard errors."""
    policies: dict[str, Callable[[Rates, Rates, np.random.Generator], dict[int, float]]] = {
        "best in nominal simulation, no trials": lambda truth, counted, random: nominal_best(counted, truth),
        "equal trials on five designs": lambda truth, counted, random: equal_trials(counted, truth, random),
        "Gaussian process on the difference to simulation": lambda truth, counted, random: gaussian_process(
            counted, designs, truth, random
        ),
        "foldcar": lambda truth, counted, random: advised(learned, designs, truth, random),
    }
    yield f"|policy|{'|'.join(f'{mark} trials' for mark in MARKS)}|"
    yield "|---" * (len(MARKS) + 1) + "|"
    for name, policy in policies.items():
        regrets = []
        for number, truth in enumerate(truths):
            for repetition in range(repetitions):
                # Another sweep would have counted other nominal rates.
                counted = (np.random.default_rng([99, repetition]).binomial(100, nominal) + 0.5) / 101
                regrets.append(list(policy(truth, counted, np.random.default_rng([number, repetition])).values()))
        points = 100 * np.array(regrets)
        errors = points.std(axis=0) / np.sqrt(len(points))
        yield f"|{name}|{'|'.join(f'{m:.1f} ± {e:.1f}' for m, e in zip(points.mean(axis=0), errors, strict=True))}|"


def scores_of(values: dict[str, float]) -> Rates:
    """Return the scores of a reality's values; the median of those that it leaves out."""
    full = {name: values.get(name, ORDINARY[name]) for name in NAMES}
    return np.clip([parameter.score(full[parameter.name]) for parameter in PARAMETERS], -MAX_SCORE, MAX_SCORE)


def distorted(truth: Rates, kind: str, driven_designs: list[int], random: np.random.Generator) -> Rates:
    """Return a truth that no reality produces, 0.3 % to 99.7 %."""
    undriven = [design for design in range(len(truth)) if design not in driven_designs]
    result = truth.copy()
    if kind == "dip at a driven design":
        result[random.choice(driven_designs)] -= 0.5
    elif kind == "dip beside driven ones":
        result[random.choice(undriven)] -= 0.5
    elif kind == "one side worse":
        result[4:] -= 0.35
    elif kind == "smooth error":
        unit = np.linspace(0, 1, len(truth))
        wave = np.sqrt(2) * np.cos(2 * np.pi * (unit * random.uniform(0.5, 1.5) + random.random()))
        result = expit(logit(result) + 1.2 * wave)
    return np.asarray(np.clip(result, 0.003, 0.997))


def coverage_row(
    name: str, learned: Learned, designs: Rates, truth_of: Callable[[list[int], np.random.Generator], Rates],
    values: dict[str, float] | None, repetitions: int,
) -> str:  # fmt: skip
    """Return a row: error, coverage and width of the bands of undriven designs after 0, 12 and 42 trials of four designs.

    With ``values``, obstacles, centre of mass and track were measured in that reality.
    """
    cells = []
    for total in (0, 12, 42):
        errors, covered, widths = [], [], []
        for repetition in range(repetitions):
            random = np.random.default_rng([total, repetition])
            # One in each quarter of the family.
            quarters = np.array_split(np.arange(len(designs)), 4)
            chosen = [int(random.choice(quarter)) for quarter in quarters]
            truth = truth_of(chosen, random)
            trials = np.full(4, total // 4) + (np.arange(4) < total % 4)
            # Each car drives CAR_TRIALS trials, or one more.
            counts = [
                (design, driven(random, truth[design], len(car)), len(car))
                for design, number in zip(chosen, trials.tolist(), strict=True)
                if number
                for car in np.array_split(np.arange(number), max(1, number // CAR_TRIALS))
            ]
            known, measured = {}, []
            if values is not None:
                for parameter, precision in MEASURABLE.items():
                    index = NAMES.index(parameter)
                    score = scores_of(values)[index] + precision * random.standard_normal()
                    known[index] = ScorePrior(float(score), precision, "measured")
                    measured.append(index)
            answers = believe(learned, designs, Trials.of_counts(counts), known, measured, learned.design_offsets)
            for design in set(range(len(designs))) - set(chosen):
                band = answers.built[design]
                errors.append(abs(band.value - truth[design]))
                covered.append(band.low - TOLERANCE <= truth[design] <= band.high + TOLERANCE)
                widths.append(band.high - band.low)
        cells.append(f"{100 * np.mean(errors):.1f}, {100 * np.mean(covered):.0f} %, {100 * np.mean(widths):.0f}")
    return f"|{name}|{'|'.join(cells)}|"


def main() -> None:
    """Simulate what the folder lacks, and print the tables."""
    parser = argparse.ArgumentParser(description="Measure regret and coverage of the advice on hidden realities.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--repetitions", type=int, default=24)
    parser.add_argument("--jobs", type=int, default=usable_processors())
    arguments = parser.parse_args()
    folder, repetitions = arguments.folder, arguments.repetitions
    folder.mkdir(parents=True, exist_ok=True)
    passed, runs = simulated_rates(folder, "nominal", arguments.jobs, "multibody", {})
    nominal = (passed + 0.5) / (runs + 1)
    learned, designs = learned_rate(folder)
    truths = {}
    for name, values in HIDDEN.items():
        passed, runs = simulated_rates(folder, name, arguments.jobs, "multibody", ORDINARY | values)
        truths[name] = np.clip(passed / runs, 0.003, 0.997)
    try:
        cambered = {"wheel_camber_rad": CAMBER_RAD}
        passed, runs = simulated_rates(folder, "MuJoCo, cambered", arguments.jobs, "mujoco", cambered)
        truths["MuJoCo, cambered wheels"] = np.clip(passed / runs, 0.003, 0.997)
    except FoldcarError as error:
        print(f"without MuJoCo: {error}")
    print(f"learned from {learned.runs} runs; error by check groups {100 * (learned.error or 0):.1f} points\n")
    hidden = [truths[name] for name in HIDDEN]
    with threadpool_limits(1):
        print("Regret (points)")
        for line in regret_table(learned, designs, nominal, hidden, repetitions):
            print(line, flush=True)
        print(
            "\nUndriven designs after 0, 12, 42 trials of four designs: mean error (points), covered, mean width (points)"
        )
        print("|truth|0 trials|12 trials|42 trials|\n|---|---|---|---|")
        few = max(1, repetitions // 4)
        for label, is_measured in (("", False), (", measured", True)):
            for name, values in HIDDEN.items():
                truth_of = partial(same_truth, truths[name])
                measured = values if is_measured else None
                print(coverage_row(name + label, learned, designs, truth_of, measured, few), flush=True)
        for kind in ("dip at a driven design", "dip beside driven ones", "one side worse", "smooth error"):
            truth_of = partial(distorted, nominal, kind)
            print(coverage_row(kind, learned, designs, truth_of, None, repetitions), flush=True)
        others = {name: truth for name, truth in truths.items() if name not in HIDDEN}
        for name, truth in (others | {"nothing ever passes": np.full(len(designs), 0.003)}).items():
            print(coverage_row(name, learned, designs, partial(same_truth, truth), None, few), flush=True)


def same_truth(truth: Rates, driven_designs: list[int], random: np.random.Generator) -> Rates:
    """Return the truth, whatever is driven."""
    return truth


if __name__ == "__main__":
    main()
