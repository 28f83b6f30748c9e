"""Renews two tables of docs/fidelity.md on simulated realities: errors of calibrated rates, coverage of their intervals.

Usage: evidence.py FOLDER PAGE. FOLDER keeps what is simulated: a second call simulates nothing that is there. Each
reality has parameters of the simulator drawn from their prior, four each in MuJoCo with soft tyres, camber, a centre of
mass aside and a supply that sags; in MuJoCo; in multibody. Ten cars of five widths drive there. Multibody,
calibrated by the outcomes of the first trials, predicts the rates of the other widths, which are compared with the
reality's.

The first table has the first four realities with 12, 24 and 48 trials. Of some calibrations obstacles, track and
centre of mass were measured. Last, multibody has the true parameters. The second table has all realities with 12 trials.

All calibrations share the runs of the prior; those of `foldcar calibrate` have some around their own posterior, too.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from calibration import kept, table
from page_block import replaced

from foldcar.belief.priors import PARAMETERS, FloatArray, ScorePrior, values_of
from foldcar.inference.calibration.emulator import Emulator, cell_inputs, prior_scores, simulate_bank
from foldcar.inference.calibration.experiment import CalibrationRun, Simulator, SweptExperiment, read_experiment
from foldcar.inference.calibration.inference import Inference, Problem, simulated_rates
from foldcar.inference.calibration.observations import Cell, Observations
from foldcar.inference.calibration.predictions import rates_of
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO, MULTIBODY
from foldcar.store.reader import Store

PROGRAM = Path(__file__).resolve().parents[1] / "scenarios" / "step_pyramids.scenic"
# Steps that weak servos climb too.
PYRAMIDS = {"step_height": 0.0215, "top_side": 0.07, "tread": 0.04, "offset": 0.05, "friction": 0.6}
WIDTHS = {"from": 65, "to": 185, "step": 10}
BEYOND = {
    "wheel_camber_rad": 0.035, "tyre_contact_time_s": 0.015, "com_y_m": 0.006, "supply_resistance_ohm": 0.3,
}  # fmt: skip
# What realities are simulated by, and what beyond the parameters they have: EACH of a kind, in this order.
KINDS: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("MuJoCo and beyond", MUJOCO, BEYOND),
    ("MuJoCo", MUJOCO, {}),
    ("multibody", MULTIBODY, {}),
)
EACH = 4
DRIVEN, CARS, TRIALS, NUMBERS = (1, 4, 6, 9, 12), 2, 48, (12, 24, 48)
# The trials' scenes begin there; those before it are the rates'.
FIRST_SCENE, RATE_SCENES = 240, 240
SETS, SEED = 3000, 1
# What can be measured of obstacles (a fraction) and of a car (m), with a standard deviation.
MEASURED = {"obstacle_height": 0.02, "com_height_m": 0.002, "track_m": 0.0005}
COVERAGE_TRIALS = 12
CONFIDENCE = 0.9


@dataclass(frozen=True)
class Reality:
    """A truth: its parameters' scores, true ``rates`` (designs,), and whether each of its trials ``passed``."""

    scores: FloatArray
    rates: FloatArray
    passed: FloatArray


class Judged(NamedTuple):
    """Means over designs in per cent: errors without and with discrepancy, covered truths, width of the bands."""

    error: float
    with_discrepancy: float
    covered: float
    width: float


def main() -> None:
    """Simulate what is missing in the folder and renew the table of the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("page", type=Path)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    with Store.open(swept(given.folder)) as store:
        experiment = read_experiment(store, "1")
    jobs = len(os.sched_getaffinity(0))
    realities = [
        kept(given.folder / f"reality{number}.pickle", partial(reality_of, experiment, number, jobs))
        for number in range(EACH * len(KINDS))
    ]
    simulator = Simulator(experiment, Carsim(), jobs, SEED)
    layout = trials_of(realities[0], TRIALS, experiment)
    bank = kept(
        given.folder / "bank.pickle", lambda: simulate_bank(simulator, prior_scores(SETS, SEED), layout, 0, silent)
    )
    inputs, width = cell_inputs(experiment, layout.cells)
    emulator = kept(given.folder / "emulator.pickle", partial(bank.emulator, inputs, width, SEED))
    study = Study(given.folder, simulator, realities, emulator)
    page = given.page.read_text(encoding="utf-8")
    for mark, lines in (("evidence", study.evidence_rows()), ("coverage", study.coverage_rows())):
        rows = "".join(f"{line}\n" for line in lines)
        page = replaced(page, given.page, f"<!-- {mark} of tools/evidence.py -->", f"<!-- end of {mark} -->", rows)
    given.page.write_text(page)


def silent(runs: int) -> None:
    """Say nothing of finished runs."""


def swept(folder: Path) -> Path:
    """The store with the nominal sweep."""
    store, listing = folder / "study.db", folder / "study.json"
    if not store.exists():
        data = {
            "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 60, "environments": 300}}},
            "vehicles": {"1": {"type": "W_B_W", "params": [
                {"common": {"width": WIDTHS, "height": 50, "radius": 60}}, {"W": {"length": 60}}, {"B": {"length": 80}},
            ]}},
            "environments": {"1": {
                "scenic_filename": str(PROGRAM), "seed": 7, "scenic_params": PYRAMIDS,
            }},
        }  # fmt: skip
        listing.write_text(json.dumps(data))
        command = [sys.executable, "-m", "foldcar", "sweep", str(listing), "--store", str(store)]
        subprocess.run(command, check=True)
    return store


def layout_of(trial: int) -> tuple[int, int, int]:
    """Design, car of that design and scene of a trial."""
    return DRIVEN[trial % len(DRIVEN)], trial // len(DRIVEN) % CARS, FIRST_SCENE + trial // len(DRIVEN)


def reality_of(experiment: SweptExperiment, number: int, jobs: int) -> Reality:
    """True rates and trials."""
    _, engine, beyond = KINDS[number // EACH]
    stream = np.random.default_rng(1000 + number)
    scores = 0.8 * stream.standard_normal((1, len(PARAMETERS)))
    values = {**values_of(scores)[0], **beyond}
    designs = range(len(experiment.designs))
    drives = [(design, scene, 1_000 + scene, scene) for design in designs for scene in range(RATE_SCENES)]
    trials = [layout_of(trial) for trial in range(TRIALS)]
    drives += [(design, scene, 5_000 + 10 * design + car, 7_000 + i) for i, (design, car, scene) in enumerate(trials)]
    runs = [CalibrationRun(design, values, experiment.scenes[scene], *numbers) for design, scene, *numbers in drives]
    passed = Simulator(experiment, Carsim(engine=engine), jobs, SEED + number).passes(runs)
    return Reality(scores[0], np.nanmean(passed[:-TRIALS].reshape(len(designs), -1), axis=1), passed[-TRIALS:])


def trials_of(reality: Reality, number: int, experiment: SweptExperiment) -> Observations:
    """The first trials of a reality, as a calibration takes them, in the cells of all."""
    layout = [layout_of(trial) for trial in range(TRIALS)]
    places = list(dict.fromkeys((design, scene) for design, _, scene in layout))
    cars = list(dict.fromkeys((design, car) for design, car, _ in layout))
    return Observations(
        tuple(Cell(design, experiment.scenes[scene]) for design, scene in places),
        np.array([places.index((design, scene)) for design, _, scene in layout[:number]]),
        np.array([cars.index((design, car)) for design, car, _ in layout[:number]]),
        np.array([design for design, _ in cars]),
        reality.passed[:number],
        True,
        (),
    )


def measured(reality: Reality, number: int) -> dict[int, ScorePrior]:
    """The priors of MEASURED parameters by index, each with an error of its value."""
    stream = np.random.default_rng(2000 + number)
    return {
        index: ScorePrior(
            float(reality.scores[index] + MEASURED[parameter.name] / parameter.sd * stream.standard_normal()),
            0.0,
            "measured",
        )
        for index, parameter in enumerate(PARAMETERS)
        if parameter.name in MEASURED
    }


def true_rates(simulator: Simulator, reality: Reality) -> FloatArray:
    """The rates (designs,) that the simulator has with the reality's parameters, without what is beyond it."""
    experiment, (values,) = simulator.experiment, values_of(reality.scores[None])
    designs, scenes = len(experiment.designs), experiment.scenes[:RATE_SCENES]
    numbers = range(designs * len(scenes))
    runs = [CalibrationRun(i // len(scenes), values, scenes[i % len(scenes)], i, i) for i in numbers]
    return np.asarray(np.nanmean(simulator.passes(runs).reshape(designs, -1), axis=1))


def calibrated(
    simulator: Simulator, observed: Observations, emulator: Emulator, priors: Mapping[int, ScorePrior]
) -> Inference:
    """As `foldcar calibrate` does, by an emulator that is not refined; rates are simulated afterwards."""
    experiment = simulator.experiment
    inputs, _ = cell_inputs(experiment, observed.cells)
    used = np.unique(observed.cell)
    inputs = np.vstack([inputs[used], inputs[len(observed.cells) :]])
    cells = tuple(observed.cells[trial] for trial in used)
    observed = replace(observed, cells=cells, cell=np.searchsorted(used, observed.cell))
    problem = Problem(observed, emulator, inputs, priors)
    designs = np.arange(len(experiment.designs))
    return simulated_rates(simulator, problem, problem.posterior(SEED), designs, 1, 10**7, silent)


@dataclass(frozen=True)
class Study:
    """Calibrations by trials of realities; ``folder`` keeps them."""

    folder: Path
    simulator: Simulator
    realities: list[Reality]
    emulator: Emulator

    @property
    def undriven(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """The designs that no car has."""
        return np.setdiff1d(np.arange(len(self.simulator.experiment.designs)), DRIVEN)

    def calibration(self, index: int, number: int, with_measures: bool) -> Inference:
        """The calibration by the first trials of a reality."""
        reality = self.realities[index]
        observed = trials_of(reality, number, self.simulator.experiment)
        priors = measured(reality, index) if with_measures else {}
        name = f"{index}-{number}{'-measured' if with_measures else ''}"
        make = partial(calibrated, self.simulator, observed, self.emulator, priors)
        inference: Inference = kept(self.folder / f"{name}.pickle", make)
        return inference

    def judged(self, index: int, inference: Inference) -> Judged:
        """Hold rates of the designs that no car has against the truth."""
        true, rates = self.realities[index].rates, rates_of(inference, self.simulator.experiment, SEED)
        low, high = np.quantile(rates.predicted, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], axis=0)
        # The truth was counted, too.
        noise = 1.645 * np.sqrt(true * (1 - true) / RATE_SCENES)
        held = (low - noise <= true) & (true <= high + noise)
        columns = (abs(rates.simulated - true), abs(rates.predicted.mean(axis=0) - true), held, high - low)
        judged = Judged(*(100 * float(column[self.undriven].mean()) for column in columns))
        print(index, np.round(judged, 1), flush=True)
        return judged

    def evidence_rows(self) -> list[str]:
        """The table of error and covered truths by number of trials, without and with measured parameters."""
        rows = []
        for number, with_measures in product(NUMBERS, (False, True)):
            results = [self.calibration(index, number, with_measures) for index in range(EACH)]
            judged = np.mean([self.judged(index, inference) for index, inference in enumerate(results)], axis=0)
            measures = "yes" if with_measures else "no"
            rows.append([str(number), measures, f"{judged[0]:.1f}", f"{judged[2]:.0f}", f"{judged[3]:.0f}"])
        floor = []
        for index, reality in enumerate(self.realities[:EACH]):
            rates = kept(self.folder / f"true{index}.pickle", partial(true_rates, self.simulator, reality))
            floor.append(np.abs(rates - reality.rates)[self.undriven].mean())
        rows.append(["true parameters", "", f"{100 * np.mean(floor):.1f}", "", ""])
        return table(["trials", "measured", "error", "covered %", "width"], rows)

    def coverage_rows(self) -> list[str]:
        """The table of error, covered truths and width of bands by kind of reality."""
        rows = []
        for with_measures, (kind, (name, _, _)) in product((False, True), enumerate(KINDS)):
            indices = range(EACH * kind, EACH * (kind + 1))
            each = [self.judged(index, self.calibration(index, COVERAGE_TRIALS, with_measures)) for index in indices]
            judged = np.mean(each, axis=0)
            measures = "yes" if with_measures else "no"
            rows.append([name, measures, f"{judged[1]:.1f}", f"{judged[2]:.0f}", f"{judged[3]:.0f}"])
        return table(["reality", "measured", "error", "covered %", "width"], rows)


if __name__ == "__main__":
    main()
