"""Writes stores of studies with given outcomes, as a sweep and `foldcar log` write them, for tests of what reads them."""

import json
import math
import uuid
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy

from foldcar.belief.priors import NAMES
from foldcar.simulation.results import NUMBERS
from foldcar.store.tables import DESIGN, EXPERIMENT, SAMPLE
from foldcar.store.trial_writer import CarFacts, Drive, Ending, TrialDesign, write_trials
from foldcar.store.writer import PlannedDesign, PlannedExperiment, StoreWriter, write_store
from foldcar.study.reality_draws import draw_runs

BUILD = "build-7"
FACTS = {
    "foldcar_version": "0.1.0",
    "scenic_version": "3.1.1",
    "carsim_build": BUILD,
    "listing_name": "study.json",
    "listing_text": "{}",
    "command": "foldcar sweep study.json --store study.db",
    "created_utc": "2025-01-02T03:04:05",
}
RULE = {"success_rule": "a run has passed if it reaches its Goal", "success_defined": True}
FIXED = {"height_mm": 50.0}
# What is said of every experiment.
EXPERIMENT_FACTS = {
    "vehicle_type": "W_B_W",
    "fixed": FIXED,
    "timeout_s": 120.0,
    "speed_m_s": None,
    "yaw_rate_rad_s": 0.0,
    "scenic_program": "step_pyramids.scenic",
    "scenic_params": {},
    "seed": 42,
    "condition": None,
    "variation": {},
    "variation_seed": 42,
    **RULE,
}
# The name of a log that is not there.
LOG = "s-logs/trial-0001-20261122T113100Z.tlog"
METRICS = {**dict.fromkeys(NUMBERS, 0.2), "elapsed_time_s": 12.5, "distance_to_target_m": None, "consumed_energy_j": 3.0}
SETTINGS = {"speed_m_s": 0.3, "yaw_rate_rad_s": 0.0, "time_limit_s": 120}
Outcome = Callable[[Mapping[str, float], int], str]


def write_study(
    store: Path,
    varied: Mapping[str, Sequence[float]],
    samples: int,
    outcome: Outcome,
    experiment: str = "1",
    build: str = BUILD,
    **facts: Any,
) -> Path:
    """Every combination of ``varied`` in ``samples`` environments; ``outcome`` (design, sample) is that of a run."""
    with write_store(store) as writer:
        writer.begin_study({**FACTS, "carsim_build": build}, build)
        add_experiment(writer, experiment, varied, samples, outcome, facts)
    return store


def add_experiment(
    writer: StoreWriter,
    name: str,
    varied: Mapping[str, Sequence[float]],
    samples: int,
    outcome: Outcome,
    facts: Mapping[str, Any],
    stored: int | None = None,
) -> None:
    """Add one experiment to an open store, with the runs of the first ``stored`` samples, or of all."""
    environment, spread = writer.environment(fingerprint(name)), writer.spread("nominal")
    study = {**EXPERIMENT_FACTS, "varied": {key: list(values) for key, values in varied.items()}, **facts}
    plan = PlannedExperiment(name, "car", "pyramids", environment, spread, samples, study)
    designs = [{**dict(zip(varied, values, strict=True)), **FIXED} for values in product(*varied.values())]
    writer.put_experiment(plan, [PlannedDesign(design, body_of(design), SETTINGS) for design in designs])
    for sample in range(samples):
        writer.put_sample(environment, sample, {"of": fingerprint(name), "sample": sample})
        writer.put_draw(spread, sample, {})
    for sample in range(samples if stored is None else stored):
        runs = writer.planned_runs(plan, sample)
        writer.add_results((run, {**METRICS, "outcome": outcome(designs[run.design], sample)}) for run in runs)


def body_of(design: Mapping[str, Any]) -> dict[str, Any]:
    """The body of a design written here."""
    return {**design, "segments": [{"mass_kg": 0.2}], "wheels": []}


def fingerprint(experiment: str) -> str:
    """The fingerprint of the environment of an experiment written here."""
    return f"environment of {experiment}"


def add_trial(store: Path, design: Mapping[str, float], sample: int, outcome: str, **options: Any) -> int:
    """Add one trial as :func:`add_trials` does; returns its number."""
    return add_trials(store, [(design, sample, outcome)], **options)[0]


def add_trials(
    store: Path,
    trials: Sequence[tuple[Mapping[str, float], int, str]],
    experiment: str = "1",
    car: str | None = "built",
    environment: str | None = None,
    program: str = "step_pyramids.scenic",
    scenes_of: str | None = None,
    settings: Mapping[str, Any] = SETTINGS,
    mass_kg: float = 0.2,
    elapsed_time_s: float = 12.0,
) -> list[int]:
    """Add trials (design, sample, outcome) where a stored run of the same design was simulated; returns their numbers.

    ``environment`` is the fingerprint of another one, ``scenes_of`` that of the one whose scenes it has.
    """
    numbers = []
    facts = CarFacts("fw", "hash", "/dev/null", car)
    with write_trials(store) as writer:
        for varied, sample, outcome in trials:
            design = {**varied, **FIXED}
            drive = Drive(
                {**body_of(design), "segments": [{"mass_kg": mass_kg}]},
                settings,
                {"of": scenes_of or environment or fingerprint(experiment), "sample": sample},
                environment or fingerprint(experiment),
                program,
                sample,
            )
            number = writer.begin(experiment, TrialDesign("W_B_W", design), drive, {}, facts, LOG, "Ada")
            writer.complete(number, Ending(outcome, "time limit", elapsed_time_s, "", None))
            numbers.append(number)
    return numbers


def import_trials(
    store: Path, trials: Sequence[tuple[Mapping[str, float], int | None, str]], source: str = "table", cars: int = 1
) -> None:
    """Add many trials (design, sample, outcome) of experiment 1, as `foldcar trials import` does.

    They are of so many built ``cars`` of each design in turn; of one without a name if it is one.
    """
    facts = {"experiment": "1", "vehicle_type": "W_B_W", "source": source, "car": "built"}
    with write_trials(store) as writer:
        writer.import_trials(
            {**facts, "uuid": str(uuid.uuid4()), "design": {**varied, **FIXED}, "sample": sample, "outcome": outcome}
            | ({"car_name": f"car {at % cars}"} if cars > 1 else {})
            for at, (varied, sample, outcome) in enumerate(trials)
        )


def write_realities(
    store: Path,
    log_odds: Callable[[Mapping[str, float], Mapping[str, float]], float],
    experiment: str = "1",
    number: int = 4000,
    scene_log_odds: Callable[[int], float] = lambda sample: 0.0,
) -> None:
    """Add runs in other realities of a written experiment, whose log-odds follow from (scores by name, design).

    Those of a sample are easier by its ``scene_log_odds``.
    """
    random = numpy.random.default_rng(1)
    with write_store(store) as writer:
        writer.begin_study(FACTS, BUILD)
        row = next(row for row in writer.rows(EXPERIMENT, "WHERE id = ?", experiment))
        facts = {**json.loads(row["facts"]), "realities": number, "reality_spread": f"realities of {experiment}"}
        with writer._transaction():
            writer._update(EXPERIMENT, {**row, "facts": json.dumps(facts)})
        spread = writer.spread(f"realities of {experiment}")
        designs = list(writer.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment))
        of_environment = "WHERE environment_id = ? ORDER BY sample"
        scenes = [sample["scene_id"] for sample in writer.rows(SAMPLE, of_environment, row["environment_id"])]
        drawn = draw_runs(facts["variation_seed"], range(number), len(designs), row["environments"])
        rows = []
        for run, (scores, index, sample) in enumerate(zip(drawn.scores, drawn.design, drawn.sample, strict=True)):
            design = designs[index]
            odds = log_odds(dict(zip(NAMES, scores.tolist(), strict=True)), json.loads(design["parameters"]))
            odds += scene_log_odds(int(sample))
            rows.append(
                {
                    "build_id": row["build_id"],
                    "spread_id": spread,
                    "body_id": design["body_id"],
                    "settings_id": design["settings_id"],
                    "scene_id": scenes[sample],
                    "number": run,
                    "scores": json.dumps(scores.tolist()),
                    "passed": int(random.random() < 1 / (1 + math.exp(-odds))),
                }
            )
        writer.add_reality_runs(rows)
