"""Estimates a sweep: its designs, those that cannot be built, its time and the size of its store.

Input: a sweep. Output: an estimate for each experiment. For it, designs are folded and runs simulated for a limited time.
Nothing is written.
"""

import time
from dataclasses import dataclass
from itertools import islice

from foldcar.car.body import body_json
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment
from foldcar.study.family import Family
from foldcar.study.reality_runs import STAGES, why_no_realities
from foldcar.study.sweep import Sweep

# Time limit for folding the designs of an experiment, and the number of designs that are simulated, each in one sample.
FOLDING_S = 20.0
PROBES = 8
# Bytes of an empty store, of a run, and of a run in another reality.
EMPTY_BYTES, RUN_BYTES, REALITY_RUN_BYTES = 100_000, 85, 100


@dataclass(frozen=True)
class Estimate:
    """The estimate of an experiment.

    ``folded`` of the ``designs`` were folded; ``refused`` names those of them that cannot be built, with reasons.
    Estimates for the whole family: ``runs`` of buildable designs, ``realities`` the number of runs in other realities at
    most, ``folding_s``, ``seconds`` of the sweep with folding, ``bytes`` of the store.
    """

    experiment: str
    designs: int
    folded: int
    refused: tuple[str, ...]
    runs: int
    realities: int
    folding_s: float
    seconds: float
    bytes: int


def fold(family: Family, limit_s: float) -> tuple[Family, float]:
    """Fold designs, spread over the family, until ``limit_s`` is over.

    Returns the family of these designs, and the estimated time for folding all (s).
    """
    started_s = time.perf_counter()
    members = []
    for position, values in family.spread_out():
        # To find whether the design can be built, this folds it; the family keeps the answer.
        family.error(values)
        members.append((position, values))
        if time.perf_counter() - started_s > limit_s:
            break
    total_s = (time.perf_counter() - started_s) / len(members) * family.combinations
    # Sorted by position, the designs are in the family's order.
    return family.only(values for _, values in sorted(members)), total_s


def estimates(sweep: Sweep, jobs: int) -> list[Estimate]:
    """Estimate every experiment with ``jobs`` simulators. Raises FoldcarError if no design of one can be built."""
    return [
        _estimate(sweep, experiment, environment, jobs)
        for experiment, environment in zip(sweep.study.experiments, sweep.environments, strict=True)
    ]


def _estimate(sweep: Sweep, experiment: Experiment, environment: Environment, jobs: int) -> Estimate:
    """Estimate an experiment: fold some designs, sample some scenes and simulate some runs, with times."""
    family, combinations = experiment.family, experiment.family.combinations
    sampled_family, folding_s = fold(family, FOLDING_S)
    refused, folded_count = tuple(sampled_family.skipped), sampled_family.combinations
    probes = list(islice(sampled_family, PROBES))
    table = sweep.carsim.parameter_table()
    bodies, scenes, requests = {}, {}, []
    # The first sample compiles the program, which must not count as the time of a sample.
    environment.sample(0)
    started_s = time.perf_counter()
    for sample in range(min(PROBES, experiment.environments)):
        scenes[f"{sample}"] = canonical_json(environment.sample(sample))
    sample_s = (time.perf_counter() - started_s) / len(scenes)
    for position, design in enumerate(probes):
        sample, nominal = position % len(scenes), body_json(design)
        bodies[f"{position}"] = canonical_json(nominal)
        settings = canonical_json(experiment.settings(design, nominal, table))
        reality = canonical_json(environment.variation(sample))
        requests.append(RunRequest(f"{position}", f"{sample}", settings, f"design {position + 1}", sample, reality))
    with environment.runner(sweep.carsim, environment.dynamic) as runner:
        started_s = time.perf_counter()
        runner.run(bodies, scenes, requests[:1])
        first_s = time.perf_counter() - started_s
        runner.run(bodies, scenes, requests * 2)
        # Subtract the simulator's start, which a sweep does once for many runs.
        run_s = max(0.0, time.perf_counter() - started_s - 2 * first_s) / (2 * len(requests) - 1)
    buildable = round(combinations * (1 - len(refused) / folded_count))
    runs = buildable * experiment.environments
    reason = why_no_realities(experiment, environment, sweep.realities, environment.dynamic, environment.success)
    realities = 0 if reason else sweep.realities or STAGES[-1]
    # With variation of cars each sample also stores a variation, which is about as long as a scene.
    scene_bytes = 2 * sum(map(len, scenes.values())) / len(scenes) if environment.variation(0) else len(scenes["0"])
    design_bytes = sum(map(len, bodies.values())) / len(bodies)
    return Estimate(
        experiment.id,
        combinations,
        folded_count,
        refused,
        runs,
        realities,
        folding_s,
        folding_s + experiment.environments * sample_s + (runs + realities) * run_s / jobs,
        round(
            EMPTY_BYTES + runs * RUN_BYTES + realities * REALITY_RUN_BYTES + buildable * design_bytes
            + experiment.environments * scene_bytes
        ),
    )  # fmt: skip
