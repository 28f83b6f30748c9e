"""What a sweep would take: its designs, those that cannot be built, its time and the size of its store.

Input: a sweep. Output: an estimate for each experiment, from designs that are folded and runs that are simulated for a
bounded time. Nothing is written.
"""

import time
from dataclasses import dataclass
from itertools import islice

from foldcar.car.body import body_json
from foldcar.car.variation import vary_body
from foldcar.simulation.runner import RunRequest
from foldcar.store.writer import canonical_json
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment
from foldcar.study.family import Family
from foldcar.study.sweep import Sweep

# Time for folding designs of an experiment (s). Of those that can be built so many are simulated, each in one sample.
FOLDING_S = 20.0
PROBES = 8
# In the store: an empty one, a run, a kept path, of which there are a bounded number.
EMPTY_BYTES, RUN_BYTES, PATH_BYTES, MAX_PATHS = 100_000, 85, 320, 9_000


@dataclass(frozen=True)
class Estimate:
    """``folded`` of the ``designs`` were folded; ``refused`` are those of them that cannot be built, with the reason.

    ``runs`` of the buildable ones, ``seconds`` of the sweep and ``bytes`` of its store are estimates.
    """

    experiment: str
    designs: int
    folded: int
    refused: tuple[str, ...]
    runs: int
    folding_s: float
    seconds: float
    bytes: int


def fold(family: Family, limit_s: float) -> tuple[Family, float]:
    """Those designs that can be folded within the limit, spread over the family, and the time for all (s)."""
    started_s, members = time.perf_counter(), []
    for place, values in family.spread_out():
        family.error(values)
        members.append((place, values))
        if time.perf_counter() - started_s > limit_s:
            break
    whole_s = (time.perf_counter() - started_s) / len(members) * family.combinations
    return family.only(values for _, values in sorted(members)), whole_s


def estimates(sweep: Sweep, jobs: int) -> list[Estimate]:
    """The estimate of every experiment with so many simulators. FoldcarError if none of its designs can be built."""
    return [
        _estimate(sweep, experiment, environment, jobs)
        for experiment, environment in zip(sweep.study.experiments, sweep.environments, strict=True)
    ]


def _estimate(sweep: Sweep, experiment: Experiment, environment: Environment, jobs: int) -> Estimate:
    family, count = experiment.family, experiment.family.combinations
    checked, folding_s = fold(family, FOLDING_S)
    refused, folded = tuple(checked.skipped), checked.combinations
    probes = list(islice(checked, PROBES))
    table = sweep.carsim.parameter_table()
    bodies, scenes, requests = {}, {}, []
    # Compiles the program, once for all samples.
    environment.sample(0)
    started_s = time.perf_counter()
    for sample in range(min(PROBES, experiment.environments)):
        scenes[f"{sample}"] = canonical_json(environment.sample(sample))
    sample_s, limits = (time.perf_counter() - started_s) / len(scenes), sweep.carsim.limits().numbers
    for place, design in enumerate(probes):
        sample, nominal = place % len(scenes), body_json(design)
        variation = environment.variation(sample)
        bodies[f"{place}"] = canonical_json(vary_body(nominal, variation, limits) if variation else nominal)
        settings = canonical_json(experiment.settings(design, nominal, table))
        requests.append(RunRequest(f"{place}", f"{sample}", settings, f"design {place + 1}", sample))
    with environment.runner(sweep.carsim, environment.dynamic) as runner:
        started_s = time.perf_counter()
        runner.run(bodies, scenes, requests[:1])
        first_s = time.perf_counter() - started_s
        runner.run(bodies, scenes, requests * 2)
        # Without the start of the simulator, which a sweep does once for many runs.
        run_s = max(0.0, time.perf_counter() - started_s - 2 * first_s) / (2 * len(requests) - 1)
    buildable = round(count * (1 - len(refused) / folded))
    runs = buildable * experiment.environments
    paths = 0 if environment.dynamic else min(runs, MAX_PATHS)
    scene_bytes = 2 * sum(map(len, scenes.values())) / len(scenes) if environment.variation(0) else len(scenes["0"])
    design_bytes = sum(map(len, bodies.values())) / len(bodies)
    return Estimate(
        experiment.id,
        count,
        folded,
        refused,
        runs,
        folding_s,
        folding_s + experiment.environments * sample_s + runs * run_s / jobs,
        round(
            EMPTY_BYTES + runs * RUN_BYTES + paths * PATH_BYTES + buildable * design_bytes
            + experiment.environments * scene_bytes
        ),
    )  # fmt: skip
