"""The simulator as a black box for notebooks and optimisers: design and environment in, result out. Nothing is stored.

Results equal those of `foldcar run` and of a sweep with the same cars, samples and settings.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.api.arguments import checked_confidence, checked_int, checked_path, finite
from foldcar.api.designs import body_and_settings, built_cars, design_of
from foldcar.api.environment import Environment, Scene, environment, simulator
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.shown_text import shown_value
from foldcar.simulation.results import NUMBERS, has_passed, no_rate_text, outcome_of
from foldcar.simulation.runner import InputRefusedError, Runner, RunRequest, side_by_side
from foldcar.statistics.rate import Rate
from foldcar.store.writer import canonical_json
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_JOBS

if TYPE_CHECKING:
    import pandas

PATH_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "heading_rad", "pitch_rad", "roll_rad")


@dataclass(frozen=True)
class SimulatedRun:
    """The result of a run.

    ``metrics`` are numbers by name, as in docs/carsim.md; if the run failed they are None, and ``message`` says why.
    ``recorded`` are the values that the Scenic program recorded, by name. ``path`` is None unless it was requested: a
    table of t_s, x_m, y_m, z_m, heading_rad, pitch_rad, roll_rad, and the angle of each hinge (``hinge_1_rad``, …). It is
    empty if the run failed.
    """

    outcome: str
    metrics: Mapping[str, float | None]
    message: str | None
    recorded: Mapping[str, Any]
    # Any, so that code that requested a path need not check for None.
    path: "pandas.DataFrame | Any"

    @property
    def passed(self) -> bool:
        """Whether the run met its environment's definition of success."""
        return self.outcome == "passed"


@dataclass(frozen=True)
class Evaluation:
    """A design's runs in samples 0 to n - 1 of an environment.

    ``runs`` is a table with the columns sample, outcome, passed, message, and a column for each metric. ``success`` says
    when a run has passed. If that is undefined (``success_defined`` is False), there is no rate.
    """

    runs: "pandas.DataFrame"
    success: str
    success_defined: bool
    confidence: float

    @cached_property
    def rate(self) -> Rate:
        """The success rate with its interval. Rejected runs are left out; failed runs count as not passed.

        Raises FoldcarError if success is undefined, or if every run was rejected.
        """
        if not self.success_defined:
            # The text says why it is not.
            raise FoldcarError(self.success)
        counted = self.runs["passed"].dropna()
        passed, runs = int(counted.sum()), len(counted)
        if not runs:
            raise FoldcarError(no_rate_text(len(self.runs)))
        counts_text = f"{passed} of {runs} simulated runs that passed"
        return Rate.from_counts(passed, runs, counts_text, confidence=self.confidence)


def simulate(
    design: Design | Mapping[str, Any],
    scene: Scene | Mapping[str, Any],
    *,
    timeout_s: float = 120.0,
    speed_m_s: float | None = None,
    yaw_rate_rad_s: float = 0.0,
    path_interval_s: float | None = None,
) -> SimulatedRun:
    """Simulate a design in one scene: ``environment(…).scene(k)``, or a scene object of docs/carsim.md.

    If ``speed_m_s`` is None, the car drives at full speed. ``path_interval_s`` requests the car's path, with rows at this
    interval up to the end of the run. Raises FoldcarError if an argument is invalid or the simulator refuses it.

    >>> steps = foldcar.environment("scenarios/step_pyramids.scenic", seed=42)
    >>> run = foldcar.simulate(foldcar.design("W_B_W", width=95), steps.scene(0), path_interval_s=0.05)
    >>> run.passed in (True, False), list(run.path.columns[:3])
    (True, ['t_s', 'x_m', 'y_m'])
    """
    car = design_of(design)
    body, settings_text = body_and_settings(car, timeout_s, speed_m_s, yaw_rate_rad_s)
    if isinstance(scene, Scene):
        scene_text, sample, runner = scene.json, scene.sample, scene.environment.runner
    elif isinstance(scene, Mapping):
        scene_text, sample, runner = _scene_json(scene), 0, simulator()
    else:
        raise FoldcarError(f"scene: {shown_value(scene)} is neither a scene of an environment nor a scene object")
    label = f"{car.title}, sample {sample}"

    def run(used_runner: Runner, **extra_settings: float) -> dict[str, Any]:
        """Simulate the run with this runner, and return its result.

        The car's ``body``, ``scene_text``, ``settings_text``, ``label`` and ``sample`` are those of the enclosing
        function. ``extra_settings`` are added to the settings of the run. Raises FoldcarError if an input is refused.
        """
        settings = settings_text
        if extra_settings:
            settings = canonical_json({**json.loads(settings_text), **extra_settings})
        # "car" and "scene" are the names by which the request refers to the two texts.
        request = RunRequest(body="car", scene="scene", settings=settings, label=label, sample=sample)
        try:
            (result,) = used_runner.run({"car": body}, {"scene": scene_text}, [request])
        except InputRefusedError as refusal:
            # carsim names a setting "run.timeout_s"; the caller of this function knows it as the argument "timeout_s".
            raise FoldcarError(refusal.reason.removeprefix("run.")) from None
        return result

    path_settings = {} if path_interval_s is None else {"path_interval_s": finite("path_interval_s", path_interval_s)}
    if runner is simulator():
        answer = with_path = run(runner, **path_settings)
    else:
        # A dynamic program decides when the run ends, but does not change the path until then. So carsim alone can
        # compute the path.
        answer = run(runner)
        with_path = run(simulator(), **path_settings) if path_settings and "error" not in answer else {}
    path = None
    if path_settings:
        path = _path_table(with_path.get("path", ()), answer.get("elapsed_time_s", 0))
    return SimulatedRun(
        outcome=outcome_of(answer),
        metrics={name: answer.get(name) for name in NUMBERS},
        message=answer.get("error"),
        recorded={name: record["value"] for name, record in answer.get("recorded", {}).items()},
        path=path,
    )


def evaluate(
    design: Design | Mapping[str, Any],
    environment: Environment | str | Path,
    n: int,
    *,
    seed: int | None = None,
    params: Mapping[str, Any] | None = None,
    timeout_s: float = 120.0,
    speed_m_s: float | None = None,
    yaw_rate_rad_s: float = 0.0,
    variation: str | Mapping[str, float] | None = None,
    variation_seed: int | None = None,
    jobs: int | None = None,
    confidence: float = 0.95,
) -> Evaluation:
    """Simulate a design in samples 0 to ``n`` - 1 of an environment; equal seeds give equal samples to every design.

    ``environment`` is a Scenic program, with ``params`` and ``seed`` (None: 0), or a result of :func:`environment`.
    ``variation`` ("workshop", or standard deviations) gives each sample its own built car, as in listings. ``jobs``
    simulators run in parallel (None: one per processor). Raises FoldcarError if an argument is invalid.

    >>> car = foldcar.design("W_B_W", width=95)
    >>> evaluation = foldcar.evaluate(car, "scenarios/step_pyramids.scenic", 5, seed=42, variation="workshop")
    >>> len(evaluation.runs), 0 <= evaluation.rate.low <= evaluation.rate.value
    (5, True)
    """
    confidence = checked_confidence(confidence)
    car = design_of(design)
    sampled_environment = _environment(environment, seed, params)
    count = checked_int("n", n, 1, MAX_ENVIRONMENTS)
    workers = checked_int("jobs", jobs, 1, MAX_JOBS) if jobs is not None else usable_processors()
    body, settings_text = body_and_settings(car, timeout_s, speed_m_s, yaw_rate_rad_s)
    realities = [""] * count
    if variation is None and variation_seed is not None:
        raise FoldcarError(f"variation_seed: {shown_value(variation_seed)} has no effect without variation")
    if variation is not None:
        seed_of_cars = sampled_environment.seed if variation_seed is None else variation_seed
        realities = built_cars(count, variation, seed_of_cars)
    scenes, requests = {}, []
    for sample in range(count):
        # The requests refer to the texts of car and scenes by these names.
        scene_name = f"s{sample}"
        scenes[scene_name] = sampled_environment.scene(sample).json
        label = f"{car.title}, sample {sample}"
        requests.append(RunRequest("car", scene_name, settings_text, label, sample, realities[sample]))
    # One call for each worker, with an equal part of the requests.
    runner = sampled_environment.runner
    requests_per_call = math.ceil(count / min(workers, count))
    calls = []
    for first in range(0, count, requests_per_call):
        part_of_requests = requests[first : first + requests_per_call]
        calls.append(partial(runner.run, {"car": body}, scenes, part_of_requests))
    answers: list[Mapping[str, Any]] = []
    for answers_of_call in side_by_side(calls, workers, runner.stop):
        answers += answers_of_call
    return Evaluation(
        runs=_table(answers, sampled_environment.success_defined),
        success=sampled_environment.success,
        success_defined=sampled_environment.success_defined,
        confidence=confidence,
    )


def _environment(
    environment_or_program: Environment | str | Path, seed: int | None, params: Mapping[str, Any] | None
) -> Environment:
    """Return the environment, or that of a program with ``seed`` and ``params``. Raises FoldcarError."""
    if not isinstance(environment_or_program, Environment):
        checked_path("environment", environment_or_program, "a Scenic program, or a result of foldcar.environment")
        return environment(environment_or_program, seed=0 if seed is None else seed, params=params)
    if seed is not None or params is not None:
        raise FoldcarError("seed, params: the environment has its own; pass them to environment(…) instead")
    return environment_or_program


def _scene_json(scene: Mapping[str, Any]) -> str:
    """Return a scene object as JSON text, without its id. Raises FoldcarError if JSON cannot hold it."""
    try:
        return canonical_json({key: value for key, value in scene.items() if key != "id"})
    except (TypeError, ValueError) as error:
        raise FoldcarError(f"scene: {error}") from None


def _table(answers: Sequence[Mapping[str, Any]], judged: bool) -> "pandas.DataFrame":
    """Return a table with a row for each answer of carsim, as in :class:`Evaluation`.

    ``judged`` is whether success is defined; otherwise `passed` is NA.
    """
    import pandas

    outcomes = [outcome_of(answer) for answer in answers]
    passed = [has_passed(outcome) if judged else None for outcome in outcomes]
    return pandas.DataFrame(
        {
            "sample": range(len(answers)),
            "outcome": pandas.array(outcomes, dtype="str"),
            "passed": pandas.array(passed, dtype="boolean"),
            "message": pandas.array([answer.get("error") for answer in answers], dtype="str"),
            **{name: pandas.array([answer.get(name) for answer in answers], dtype="float64") for name in NUMBERS},
        }
    )


def _path_table(rows: Sequence[Sequence[float]], elapsed_time_s: float) -> "pandas.DataFrame":
    """Return the rows of a path up to ``elapsed_time_s`` as a table, as in :class:`SimulatedRun`."""
    import pandas

    hinge_count = len(rows[0]) - len(PATH_COLUMNS) if rows else 0
    hinge_columns = [f"hinge_{number}_rad" for number in range(1, hinge_count + 1)]
    # A row begins with its time (s).
    rows_of_run = [row for row in rows if row[0] <= elapsed_time_s]
    return pandas.DataFrame(rows_of_run, columns=[*PATH_COLUMNS, *hinge_columns])
