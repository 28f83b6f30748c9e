"""Writes a store of a million runs, to measure report, compare, select and export: `bench/big_store.py STORE`.
With `--trials 100000` it also has trials, to measure `trials list`.

The runs' results are DRAWN from a smooth success over the designs' first two parameters, not simulated: no number in
such a store says anything about cars. Designs, scenes and rows are those that a sweep writes, by its own writer. Scenes
are sampled SCENES times and then repeat, each under a name of its own. Keep the store outside the repository. With
`--listing scenarios/kerb.json` its family is that of bench/scale.py, and a sweep of that listing finds nothing to do.
"""

import argparse
import itertools
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy

from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import NATIVE_OUTCOMES, NUMBERS
from foldcar.store.trial_writer import write_trials
from foldcar.store.writer import PlannedRun, StoreWriter, write_store
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment, read_study
from foldcar.study.planned_designs import PlannedDesigns
from foldcar.study.sweep import plan_experiment, study_facts

PROJECT = Path(__file__).resolve().parents[1]
SCENES = 200
BATCH_RUNS = 20_000


def listing(widths: int, radii: int, environments: int) -> dict[str, Any]:
    """A listing of ``widths`` times ``radii`` cars, each in ``environments`` environments."""

    def span(first: float, step: float, count: int) -> Any:
        return first if count == 1 else {"from": first, "to": first + step * (count - 1), "step": step}

    common = {"width": span(65, 4, widths), "height": 50, "radius": span(40, 1.5, radii)}
    modules = [{"common": common}, {"W": {"length": 60, "tire_thickness": 12}}, {"B": {"length": 80}}]
    program = str(PROJECT / "scenarios" / "step_pyramids.scenic")
    return {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": {"timeout": 120, "environments": environments}}},
        "vehicles": {"1": {"type": "W_B_W", "params": modules}},
        "environments": {"1": {"scenic_filename": program, "seed": 42}},
    }


def main() -> None:
    """Write the store named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("store", type=Path)
    parser.add_argument("--listing", type=Path, help="instead of widths times radii; its first experiment")
    parser.add_argument("--widths", type=int, default=50)
    parser.add_argument("--radii", type=int, default=20)
    parser.add_argument("--environments", type=int, default=1000, help="for each car")
    parser.add_argument("--trials", type=int, default=0, help="of the family's cars in turn, with drawn outcomes")
    chosen = parser.parse_args()
    if chosen.store.exists() or chosen.store.resolve().is_relative_to(PROJECT):
        parser.error(f"{chosen.store}: is there already, or is inside the repository")
    carsim = Carsim()
    with tempfile.TemporaryDirectory() as folder:
        file = chosen.listing
        if file is None:
            file = Path(folder, "drawn_results.json")
            file.write_text(json.dumps(listing(chosen.widths, chosen.radii, chosen.environments)))
        study = read_study(file, environments=chosen.environments)
        experiment = study.experiments[0]
        with write_store(chosen.store) as writer:
            facts = study_facts(study, carsim, "bench/big_store.py: results drawn, not simulated")
            writer.begin_study(facts, carsim.build)
            print(write_runs(writer, experiment, carsim), "runs")
        if chosen.trials:
            with write_trials(chosen.store) as trials:
                print(len(trials.import_trials(list(drawn_trials(experiment, chosen.trials)))), "trials")


def write_runs(writer: StoreWriter, experiment: Experiment, carsim: Carsim) -> int:
    """Write all runs of the experiment with drawn results; gives their number."""
    environment = Environment(experiment)
    plan = plan_experiment(experiment, environment, writer, PlannedDesigns(experiment, carsim.parameter_table(), None))
    writer.is_dynamic(plan.environment_id, lambda: environment.dynamic)
    scenes = [environment.sample(k) for k in range(min(SCENES, plan.environments))]
    designs = [tuple(design.columns[name] for name in experiment.family.varied) for design in experiment.family]
    runs = drawn(writer, plan, scenes, numpy.array(designs, dtype=float))
    written = 0
    while batch := list(itertools.islice(runs, BATCH_RUNS)):
        writer.add_results(batch)
        written += len(batch)
    return written


def drawn_trials(experiment: Experiment, count: int) -> Iterator[dict[str, Any]]:
    """Trials as `foldcar trials import` takes them, half of which pass."""
    random = numpy.random.default_rng(2)
    designs = itertools.cycle(experiment.family)
    for number, design in zip(range(count), designs, strict=False):
        yield {
            "uuid": str(number),
            "experiment": experiment.id,
            "vehicle_type": design.type,
            "design": design.columns,
            "sample": number % experiment.environments,
            "outcome": "passed" if random.random() < 0.5 else "stuck",
            "elapsed_time_s": float(random.gamma(20, 0.3)),
            "source": "drawn, not driven",
            "car": "built",
        }


def drawn(
    writer: StoreWriter, plan: Any, scenes: Sequence[Mapping[str, Any]], designs: numpy.typing.NDArray[numpy.float64]
) -> Iterator[tuple[PlannedRun, Mapping[str, Any]]]:
    """Every run with a result: in each environment, which is hard or easy for all, a design passes by its success."""
    random = numpy.random.default_rng(1)
    span = numpy.maximum(numpy.ptp(designs, axis=0), 1)
    place = (designs - designs.min(axis=0)) / span
    # The middle of the first parameter is best; the second moves that middle.
    ease = 3 - 14 * (place[:, 0] - 0.35 - 0.3 * place[:, -1] * (place.shape[1] > 1)) ** 2 * 2
    for sample in range(plan.environments):
        writer.put_sample(plan.environment_id, sample, scenes[sample % len(scenes)], dynamic=True)
        writer.put_draw(plan.spread_id, sample, {}, "")
        passes = random.logistic(size=len(designs)) + random.normal() < ease
        ends = random.choice(NATIVE_OUTCOMES[1:5], size=len(designs), p=(0.5, 0.3, 0.1, 0.1))
        times = random.gamma(20, 0.3 + 0.2 * place[:, 0])
        for run in writer.planned_runs(plan, sample):
            at = run.design
            yield (
                run,
                {
                    "outcome": "passed" if passes[at] else str(ends[at]),
                    **dict.fromkeys(NUMBERS, float(0.1 + 0.02 * times[at])),
                    "elapsed_time_s": float(times[at]),
                },
            )


if __name__ == "__main__":
    main()
