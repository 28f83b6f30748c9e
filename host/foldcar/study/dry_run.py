"""Estimates a sweep: its designs, those that cannot be built, its time and the size of its store.

Input: a sweep. Output: an estimate for each experiment. For it, designs are folded and runs simulated for a limited time.
Nothing is written.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from foldcar.car.body import body_json
from foldcar.simulation.runner import Runner, RunRequest
from foldcar.store.writer import canonical_json
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment
from foldcar.study.family import Family
from foldcar.study.reality_runs import STAGES, why_no_realities
from foldcar.study.sweep import Sweep

# Time limit for folding the designs of an experiment, and the number of designs that are simulated, each in one sample.
FOLDING_S = 20.0
PROBES = 8
# Runs are repeated until they take so long (s), but are not more than this.
PROBES_S, MAX_PROBES = 0.3, 1000
# Bytes of an empty store, of a run, and of a run in another reality.
EMPTY_BYTES, RUN_BYTES, REALITY_RUN_BYTES = 100_000, 85, 100


@dataclass(frozen=True)
class SweepEstimate:
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
    """Fold designs of the family until ``limit_s`` is over, and return them with the estimated time for folding all (s).

    To fold a design is to compute its folded car, which shows whether it can be built. The designs are chosen so that
    they are spread over the whole family. They are returned as a family, which knows the results.
    """
    started_s = time.perf_counter()
    members = []
    for position, values in family.spread_out():
        # This folds the design to find whether it can be built. The family keeps the result.
        family.error(values)
        members.append((position, values))
        if time.perf_counter() - started_s > limit_s:
            break
    total_s = (time.perf_counter() - started_s) / len(members) * family.combinations
    # Sorted by position, the designs are in the family's order.
    return family.only(values for _, values in sorted(members)), total_s


def estimates(sweep: Sweep, jobs: int) -> list[SweepEstimate]:
    """Estimate every experiment with ``jobs`` simulators. Raises FoldcarError if no design of one can be built."""
    return [
        _estimate(sweep, experiment, environment, jobs)
        for experiment, environment in zip(sweep.study.experiments, sweep.environments, strict=True)
    ]


def _estimate(sweep: Sweep, experiment: Experiment, environment: ExperimentEnvironment, jobs: int) -> SweepEstimate:
    """Estimate how long an experiment takes and how large its store becomes.

    For this, some designs are folded, some scenes are sampled, and some runs are simulated.
    """
    sampled_family, folding_s = fold(experiment.family, FOLDING_S)
    refused = tuple(sampled_family.skipped)
    buildable_fraction = 1 - len(refused) / sampled_family.combinations
    scenes, sample_s = _sampled_scenes(experiment, environment)
    bodies, requests = _probes(sweep, experiment, environment, sampled_family, len(scenes))
    with environment.runner(sweep.carsim, environment.dynamic) as runner:
        run_s = _seconds_of_a_run(runner, bodies, scenes, requests)
    buildable = round(experiment.family.combinations * buildable_fraction)
    runs = buildable * experiment.environments
    realities = _max_realities(sweep, experiment, environment)
    # How many bytes a sample takes in the store.
    sample_bytes = round(_mean_length(scenes))
    if environment.variation(0):
        # Each sample also stores how its cars vary, which is about as long as a scene.
        sample_bytes = 2 * sample_bytes
    return SweepEstimate(
        experiment=experiment.id,
        designs=experiment.family.combinations,
        folded=sampled_family.combinations,
        refused=refused,
        runs=runs,
        realities=realities,
        folding_s=folding_s,
        seconds=folding_s + experiment.environments * sample_s + (runs + realities) * run_s / jobs,
        bytes=round(
            EMPTY_BYTES
            + runs * RUN_BYTES
            + realities * REALITY_RUN_BYTES
            + buildable * _mean_length(bodies)
            + experiment.environments * sample_bytes
        ),
    )


def _sampled_scenes(experiment: Experiment, environment: ExperimentEnvironment) -> tuple[dict[str, str], float]:
    """Return the JSON of some scenes by their sample, and the time to draw one scene (s)."""
    # The first sample compiles the program, which must not count as the time of a sample.
    environment.sample(0)
    started_s = time.perf_counter()
    scenes = {}
    for sample in range(min(PROBES, experiment.environments)):
        scenes[f"{sample}"] = canonical_json(environment.sample(sample))
    return scenes, (time.perf_counter() - started_s) / len(scenes)


def _probes(
    sweep: Sweep, experiment: Experiment, environment: ExperimentEnvironment, family: Family, samples: int
) -> tuple[dict[str, str], list[RunRequest]]:
    """Return the JSON of the bodies of some designs, and a run of each; the runs use the first ``samples`` samples."""
    table = sweep.carsim.parameter_table()
    bodies: dict[str, str] = {}
    requests: list[RunRequest] = []
    for position, design in enumerate(islice(family, PROBES)):
        sample = position % samples
        body = body_json(design)
        body_id = str(position)
        bodies[body_id] = canonical_json(body)
        requests.append(
            RunRequest(
                body=body_id,
                scene=str(sample),
                settings=canonical_json(experiment.settings(design, body, table)),
                label=f"design {position + 1}",
                sample=sample,
                reality=canonical_json(environment.variation(sample)),
            )
        )
    return bodies, requests


def _seconds_of_a_run(
    runner: Runner, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
) -> float:
    """Return the mean time to simulate one of these runs (s), without the simulator's start."""

    def timed(probes: Sequence[RunRequest]) -> float:
        """Return how long the simulator takes for these runs, including its start (s)."""
        started_s = time.perf_counter()
        runner.run(bodies, scenes, probes)
        return time.perf_counter() - started_s

    # The time of the start and of a single run. The shorter of two times is less disturbed by other processes.
    start_and_one_run_s = min(timed(requests[:1]), timed(requests[:1]))
    # The time of the start varies. To measure the time of a run well, the runs must take much longer than that, so they
    # are repeated more and more often.
    probes = list(requests) * 2
    further_runs_s = timed(probes) - start_and_one_run_s
    while further_runs_s < PROBES_S and len(probes) < MAX_PROBES:
        probes = probes * 4
        further_runs_s = timed(probes) - start_and_one_run_s
    return max(0.0, further_runs_s) / (len(probes) - 1)


def _max_realities(sweep: Sweep, experiment: Experiment, environment: ExperimentEnvironment) -> int:
    """Return how many runs in other realities the sweep has at most."""
    if why_no_realities(experiment, environment, sweep.realities, environment.dynamic, environment.success):
        return 0
    return STAGES[-1] if sweep.realities is None else sweep.realities


def _mean_length(texts: Mapping[str, str]) -> float:
    return sum(len(text) for text in texts.values()) / len(texts)
