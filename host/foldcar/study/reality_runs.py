"""Simulates the runs of an experiment in other realities, from which the success rate of built cars is learned.

Input: a swept experiment. Output: rows in the store, and how well the success rate was learned from them. Each run has a
reality, a design, a scene and a car of its own (reality_draws.py). Rows that the store has are not simulated again.
"""

import json
import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from foldcar.belief.priors import PARAMETERS, values_of
from foldcar.belief.reality import drawn_reality
from foldcar.scenes.fingerprint import variation_code
from foldcar.scenes.success import SuccessRule
from foldcar.simulation.results import FAILED, outcome_of
from foldcar.simulation.runner import Runner
from foldcar.store.designs import DesignCounts
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.reality_runs import (
    BLOCK,
    CHECK,
    FloatArray,
    ReadableStore,
    RealityKeys,
    RealityRuns,
    read_reality_runs,
    reality_keys,
    stored_keys,
)
from foldcar.store.tables import DESIGN
from foldcar.store.writer import StoreWriter, canonical_json
from foldcar.study.chunks import ChunkInputs, ChunkPool, FinishedRun, Simulators, stored_inputs
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment
from foldcar.study.limits import MAX_REALITIES
from foldcar.study.reality_draws import draw_runs
from foldcar.study.reality_environment import hashed, reality_code

# Fewer scenes do not represent an environment.
MIN_SCENES = 20
# The numbers of runs after which the learning's error decides whether more are simulated.
STAGES = (4_000, 8_000)
# Fewer runs teach nothing of built cars.
MIN_LEARNED = 200
# The largest error of the learned success rate that is small enough.
MAX_ERROR = 0.05
# Failed simulations are left out if they are at most this fraction.
MAX_FAILED = 0.02
# Numbers that are drawn at a time; a multiple of BLOCK.
DRAWN_RUNS = 200 * BLOCK


def why_no_realities(
    experiment: Experiment, environment: ExperimentEnvironment, requested: int | None, dynamic: bool, success: SuccessRule
) -> str | None:
    """Return the reason why an experiment gets no runs in other realities, or None if it gets some.

    The reason is a sentence without a full stop. ``requested`` is the number of runs that the user has asked for; it is
    None if foldcar chooses the number. ``dynamic`` is whether Scenic must run the environment's program during the
    simulation. Scenes of such a program cannot be changed to another reality.
    """
    if environment.reality is not None:
        return "the experiment itself is simulated in another reality"
    if requested == 0:
        return "the sweep left them out (--realities 0)"
    if dynamic:
        return "its program runs beside the simulation, which other realities cannot change"
    if not success.defined:
        return f"the success rate cannot be learned: {success.text}"
    if experiment.environments < MIN_SCENES:
        return f"they need {MIN_SCENES} or more samples of the environment, and the sweep has {experiment.environments}"
    return None


def reality_facts(experiment: Experiment, requested: int | None, stored: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the store keeps about an experiment's runs in other realities: their number and their fingerprint.

    ``requested`` is the number of runs that the user has asked for. If it is None, foldcar plans STAGES[0] runs, or as
    many as the last sweep of this experiment planned, if these are more. ``stored`` are the facts of the last sweep.
    """
    fingerprint = realities_fingerprint(experiment)
    if requested is not None:
        return {"realities": requested, "reality_spread": fingerprint}
    earlier_planned = 0
    if stored.get("reality_spread") == fingerprint:
        earlier_planned = stored["realities"]
    return {"realities": max(STAGES[0], earlier_planned), "reality_spread": fingerprint}


def realities_fingerprint(experiment: Experiment) -> str:
    """Return a hash of everything that determines in which reality each run of an experiment is simulated.

    A *reality* is a set of random values of what the simulator does not know, such as friction. They are drawn from the
    priors, which are probability distributions.
    """
    priors = [[parameter.name, parameter.prior, parameter.middle, parameter.sd] for parameter in PARAMETERS]
    return hashed(
        # Runs are drawn in groups. These are the size of a group, and how many of its first runs share one reality and
        # one design.
        BLOCK,
        CHECK,
        dict(experiment.variation),
        experiment.variation_seed,
        reality_code(),
        priors,
        variation_code(),
    )


def next_number(runs: int, error: float | None) -> int | None:
    """Return the number of runs after ``runs`` have given the learning's ``error``; None if these are enough."""
    if error is not None and error <= MAX_ERROR:
        return None
    later_stages = [stage for stage in STAGES if stage > runs]
    return later_stages[0] if later_stages else None


def offered_runs(runs: int, error: float | None) -> int | None:
    """Return a larger number of runs, with which the error of learning would be smaller.

    ``runs`` is the present number, and ``error`` the present error. The result is twice as many runs, in whole blocks of
    BLOCK runs. It is None if the error is small enough or unknown, or if the result would be above MAX_REALITIES.
    """
    if error is None or error <= MAX_ERROR:
        return None
    whole_blocks = math.ceil(runs / BLOCK)
    offered = 2 * BLOCK * whole_blocks
    return offered if offered <= MAX_REALITIES else None


@dataclass(frozen=True, slots=True)
class RealityRun:
    """A run in another reality: its number, index of the design, sample, the ids of its inputs, scores."""

    number: int
    design: int
    sample: int
    body_id: int
    settings_id: int
    scene_id: int
    scores: tuple[float, ...]

    @property
    def key(self) -> tuple[int, int, int, int]:
        """What identifies the run among those of its build and realities."""
        return self.number, self.body_id, self.settings_id, self.scene_id


def missing_runs(store: ReadableStore, keys: RealityKeys, seed: int, samples: int, total: int) -> Iterator[RealityRun]:
    """Yield those of an experiment's first ``total`` runs in other realities that are not in the store yet.

    A *reality* is a set of random values of what the simulator does not know, such as friction. The runs are numbered
    from 0. The ``seed`` and its number determine a run's reality, design and sample. ``samples`` is the experiment's
    number of samples. A run whose scene is not stored has the scene's id 0. The store is read when the first run is
    requested.
    """
    stored = stored_keys(store, keys)
    for start in range(0, total, DRAWN_RUNS):
        numbers = range(start, min(total, start + DRAWN_RUNS))
        drawn = draw_runs(seed, numbers, len(keys.designs), samples)
        drawn_designs, drawn_samples = drawn.design.tolist(), drawn.sample.tolist()
        for number, design, sample, scores in zip(
            numbers, drawn_designs, drawn_samples, drawn.scores.tolist(), strict=True
        ):
            body_id, settings_id = keys.designs[design]
            run = RealityRun(
                number=number,
                design=design,
                sample=sample,
                body_id=body_id,
                settings_id=settings_id,
                scene_id=keys.scenes.get(sample, 0),
                scores=tuple(scores),
            )
            if run.key not in stored:
                yield run


def planned_reality_runs(store: ReadableStore, experiment: str, seed: int, samples: int) -> RealityRuns:
    """Return the stored runs of an experiment in other realities that belong to its latest sweep.

    ``seed`` is the seed of the experiment's variation, and ``samples`` its number of samples. The store may contain
    further runs of the same designs and scenes, which another experiment or an earlier sweep has made. In those, the same
    run number drew another design or another scene. They are left out, because what is learned must not depend on them.
    Raises StoreError.
    """
    keys, runs = reality_keys(store, experiment), read_reality_runs(store, experiment)
    if keys is None or not len(runs):
        return runs
    drawn = draw_runs(seed, range(int(runs.number[-1]) + 1), len(keys.designs), samples)
    # Compare the ids of bodies and scenes, because several designs may have equal bodies, and several samples equal
    # scenes. ``car_ids`` (designs, 2) has the ids of body and settings. A scene that is not stored has the id 0.
    car_ids = np.array(keys.designs)
    scene_ids = np.array([keys.scenes.get(sample, 0) for sample in range(samples)])
    planned_design = drawn.design[runs.number]
    planned_sample = drawn.sample[runs.number]
    is_planned_car = (car_ids[runs.design] == car_ids[planned_design]).all(axis=1)
    is_planned_scene = scene_ids[runs.sample] == scene_ids[planned_sample]
    return runs.taken(is_planned_car & is_planned_scene)


def missing_realities(store: Store, info: ExperimentInfo) -> int:
    """Return how many of an experiment's planned runs in other realities are not stored."""
    keys = reality_keys(store, info.id)
    if keys is None or not keys.designs:
        return info.realities
    missing = missing_runs(store, keys, info.variation_seed, samples=info.environments, total=info.realities)
    return sum(1 for _ in missing)


def learning_error(
    runs: RealityRuns, designs: FloatArray, variation: Collection[str], counts: DesignCounts
) -> float | None:
    """Learn the success rate from runs in other realities, and return its error (0 to 1), or None if it is unknown.

    A *reality* is a set of values of what the simulator does not know exactly, such as friction. Nominal runs are those
    with the assumed values; ``counts`` are their numbers for each design, and ``variation`` has the names of the
    quantities that vary between their cars. ``designs`` (designs, parameters) are the values of the parameters that vary.
    """
    from threadpoolctl import threadpool_limits

    from foldcar.belief.learning import learn, nominal_runs

    # This learns exactly as `foldcar select` does, so that both state the same error.
    with threadpool_limits(1):
        error: float | None = learn(runs, designs, nominal_runs(variation, counts)).error
    return error


@dataclass
class RealityCounts:
    """Counts of an experiment's runs in other realities.

    ``reused`` ones of ``total`` were in the store, ``new`` ones were simulated, of which ``failed`` ones failed.
    ``error`` is that of the learned success rate, 0 to 1, None if it is unknown. ``left_out`` says why there are no such
    runs. ``seconds`` is the time of simulation.
    """

    total: int = 0
    new: int = 0
    reused: int = 0
    failed: int = 0
    error: float | None = None
    left_out: str = ""
    seconds: float = 0.0

    @property
    def done(self) -> int:
        """The number of stored runs."""
        return self.new + self.reused

    @property
    def too_many_failed(self) -> bool:
        """Whether so many simulations failed that the others may not represent the realities."""
        return self.failed > MAX_FAILED * self.new


@dataclass(frozen=True)
class RealitySimulation:
    """Simulates an experiment's runs in other realities with ``runner``.

    ``report`` is called after every stored chunk, after ``counts`` have changed.
    """

    experiment: Experiment
    writer: StoreWriter
    simulators: Simulators | int
    runner: Runner
    counts: RealityCounts
    report: Callable[[], None]

    def simulate(self, total: int) -> None:
        """Simulate those of the first ``total`` runs that are not in the store. Raises FoldcarError."""
        counts = self.counts
        keys = reality_keys(self.writer, self.experiment.id)
        assert keys is not None, "the experiment was planned with runs in other realities"
        number_missing = sum(1 for _ in self._missing(keys, total))
        number_stored = total - number_missing
        counts.total = total
        # The new runs of earlier calls are stored by now, but they still count as new.
        counts.reused = number_stored - counts.new
        self.report()
        # The time of earlier calls is included.
        started_s = time.perf_counter() - counts.seconds
        pool = ChunkPool(self.simulators, self._inputs, lambda run: run.key)
        with pool, pool.using(self.runner):
            # The missing runs are drawn a second time, because a list of them would need much memory.
            for run in self._missing(keys, total):
                for finished_runs in pool.add(run, runs_left=counts.total - counts.done):
                    self._store(keys, finished_runs, started_s)
            for finished_runs in pool.finish():
                self._store(keys, finished_runs, started_s)

    def _missing(self, keys: RealityKeys, total: int) -> Iterator[RealityRun]:
        """Yield those of the first ``total`` runs that are not in the store."""
        seed, samples = self.experiment.variation_seed, self.experiment.environments
        return missing_runs(self.writer, keys, seed, samples, total)

    def error(self) -> float | None:
        """Return how far the learned success rates are probably from the true ones, 0 to 1; None if this is unknown.

        The rates are learned from the stored runs in *other realities*, in which the simulator's uncertain parameters
        have other values than the nominal ones.
        """
        experiment = self.experiment
        rows = self.writer.rows(DESIGN, "WHERE experiment = ? ORDER BY position", experiment.id)
        varied = list(experiment.family.varied)
        varied_values = []
        for row in rows:
            parameters = json.loads(row["parameters"])
            varied_values.append([parameters[name] for name in varied])
        designs = np.array(varied_values, dtype=float)
        runs = planned_reality_runs(self.writer, experiment.id, experiment.variation_seed, experiment.environments)
        counts = self.writer.design_counts(experiment.id)
        return learning_error(runs, designs, experiment.variation, counts)

    def _inputs(self, runs: Sequence[RealityRun]) -> ChunkInputs:
        """Return what the simulator needs for these runs.

        Bodies, scenes and settings are in the store. The realities, which say how car and ground differ from these, are
        drawn here from the runs' scores.
        """
        variation, seed = self.experiment.variation, self.experiment.variation_seed
        values_of_runs = values_of(np.array([run.scores for run in runs]))
        realities = []
        for run, values in zip(runs, values_of_runs, strict=True):
            # The faults of a car, such as a wheel that is out of round, are drawn from its name. This name gives each run
            # in another reality a car of its own.
            car = f"reality {run.number}"
            reality = drawn_reality(values, variation, seed, drive=run.number, car=car)
            realities.append(canonical_json(reality))
        labels = [f"design {run.design + 1}, run {run.number} in another reality" for run in runs]
        return stored_inputs(self.writer, runs, labels, realities)

    def _store(self, keys: RealityKeys, finished_runs: list[FinishedRun[RealityRun]], started_s: float) -> None:
        """Store a finished chunk of a simulation that began at ``started_s``, count it and report."""
        rows = []
        for finished_run in finished_runs:
            run, outcome = finished_run.run, outcome_of(finished_run.answer)
            rows.append(
                {
                    "build_id": keys.build_id,
                    "spread_id": keys.spread_id,
                    "body_id": run.body_id,
                    "settings_id": run.settings_id,
                    "scene_id": run.scene_id,
                    "number": run.number,
                    "scores": json.dumps(run.scores, separators=(",", ":")),
                    "passed": None if outcome == FAILED else int(outcome == "passed"),
                }
            )
        self.writer.add_reality_runs(rows)
        self.counts.new += len(rows)
        self.counts.seconds = time.perf_counter() - started_s
        self.counts.failed += sum(row["passed"] is None for row in rows)
        self.report()
