"""Runs the cases of a study in carsim and in MuJoCo; what the cache knows is not run again.

Input: cases, a simulator, a cache. Output: results by engine, in the order of the cases, None where an engine
was not asked: MuJoCo at half the time step and with other tyres runs the first few samples only.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import foldcar.crosscheck
import foldcar.models
import foldcar.simulation
from foldcar.crosscheck.carsim_runs import ask, path_until, run_in_carsim, run_in_mujoco_beside_scenic
from foldcar.crosscheck.cases import Case
from foldcar.crosscheck.mujoco_car import EngineOptions, import_mujoco
from foldcar.crosscheck.pool import Task, run_all
from foldcar.crosscheck.result_cache import ResultCache, result_key
from foldcar.models.ground import HeightGrid, smooth_ground
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.pulses import PulseTrain, ask_pulses
from foldcar.store.writer import canonical_json

CARSIM, MUJOCO, HALF_STEP, ELLIPSOID = "carsim", "mujoco", "mujoco_half_step", "mujoco_ellipsoid"
OPTIONS = {
    MUJOCO: EngineOptions(),
    HALF_STEP: EngineOptions(timestep_s=EngineOptions().timestep_s / 2),
    ELLIPSOID: EngineOptions(tyre="ellipsoid"),
}
ENGINES = (CARSIM, *OPTIONS)
# The sources that MuJoCo's results depend on.
SOURCES = (
    (foldcar.crosscheck, ("ending.py", "mujoco_car.py", "mujoco_run.py", "mujoco_step.py")),
    (
        foldcar.models,
        ("ground.py", "mjcf.py", "mjcf_terrain.py", "put_down.py", "servo.py", "wheel_geometry.py", "xml_elements.py"),
    ),
    (foldcar.simulation, ("pulses.py",)),
)

Results = dict[str, list[dict[str, Any] | None]]


def planned_runs(cases: Sequence[Case], baseline: int) -> int:
    """Runs in all engines together."""
    few = sum(case.sample < baseline for case in cases)
    return 2 * len(cases) + (len(ENGINES) - 2) * few


def compare(
    cases: Sequence[Case],
    carsim: Carsim,
    cache: ResultCache,
    jobs: int,
    baseline: int,
    done: Callable[[int], None] = lambda count: None,
) -> Results:
    """Run what is missing; ``done`` hears of every run that is known, with how many."""
    import_mujoco()
    results: Results = {engine: [None] * len(cases) for engine in ENGINES}
    _run_carsim(cases, carsim, cache, jobs, results[CARSIM], done)
    _run_mujoco(cases, carsim, cache, jobs, baseline, results, done)
    return results


def run_with_paths(
    case: Case, known: Sequence[Mapping[str, Any]], carsim: Carsim, interval_s: float
) -> list[dict[str, Any]]:
    """The ``known`` results of a case in carsim and MuJoCo, with the paths that led there."""
    (theirs,) = ask(carsim, [case], interval_s)
    (pulses,) = ask_pulses(carsim, [case.settings])
    options = EngineOptions(path_interval_s=interval_s)
    task = Task(case.body, case.scene, pulses, carsim.limits().trial, smooth_ground(case.scene, carsim), options)
    ((_, ours),) = run_all([task], 1)
    # A program may have ended the run before the engine alone does.
    return [
        {**result, "path": path_until(run["path"], result["elapsed_time_s"])}
        for result, run in zip(known, (theirs, ours), strict=True)
    ]


def _run_carsim(
    cases: Sequence[Case],
    carsim: Carsim,
    cache: ResultCache,
    jobs: int,
    results: list[dict[str, Any] | None],
    done: Callable[[int], None],
) -> None:
    keys = [result_key(CARSIM, carsim.build, c.body, c.scene, c.settings, c.identity) for c in cases]
    results[:] = [cache.get(key) for key in keys]
    missing = [(index, cases[index]) for index, result in enumerate(results) if result is None]
    done(len(cases) - len(missing))
    for index, result in run_in_carsim(missing, carsim, jobs):
        results[index] = result
        cache.put(keys[index], CARSIM, result)
        done(1)


def _run_mujoco(
    cases: Sequence[Case],
    carsim: Carsim,
    cache: ResultCache,
    jobs: int,
    baseline: int,
    results: Results,
    done: Callable[[int], None],
) -> None:
    trains = _pulse_trains(cases, carsim)
    rules = carsim.limits().trial
    version = [import_mujoco().__version__, _code_hash(), asdict(rules)]
    asked: list[tuple[str, int, str]] = []
    beside: list[tuple[str, int, str]] = []

    def missing() -> Iterator[Task]:
        for index, (case, grid) in enumerate(_with_grids(cases, carsim)):
            pulses = trains[canonical_json(case.settings)]
            ground = None if grid is None else hashlib.sha256(grid.z_m.tobytes()).hexdigest()
            drive = [pulses.times_s, pulses.widths_us]
            for engine, options in OPTIONS.items():
                if engine != MUJOCO and case.sample >= baseline:
                    continue
                key = result_key(engine, version, case.body, case.scene, ground, drive, case.identity)
                known = cache.get(key)
                if known is not None:
                    results[engine][index] = known
                    done(1)
                elif case.beside is not None:
                    beside.append((engine, index, key))
                else:
                    asked.append((engine, index, key))
                    yield Task(case.body, case.scene, pulses, rules, grid, options)

    def keep(engine: str, index: int, key: str, result: dict[str, Any]) -> None:
        results[engine][index] = result
        cache.put(key, engine, result)
        done(1)

    for number, result in run_all(missing(), jobs):
        keep(*asked[number], result)
    for engine, options in OPTIONS.items():
        keys = {index: key for one, index, key in beside if one == engine}
        numbered = [(index, cases[index]) for index in keys]
        for index, result in run_in_mujoco_beside_scenic(numbered, carsim, jobs, options):
            keep(engine, index, keys[index], result)


def _with_grids(cases: Iterable[Case], carsim: Carsim) -> Iterator[tuple[Case, HeightGrid | None]]:
    """Each case with its ground; designs in the same scene follow each other and share it."""
    scene: Mapping[str, Any] | None = None
    grid = None
    for case in cases:
        if case.scene is not scene:
            scene, grid = case.scene, smooth_ground(case.scene, carsim)
        yield case, grid


def _pulse_trains(cases: Iterable[Case], carsim: Carsim) -> dict[str, PulseTrain]:
    settings = {canonical_json(case.settings): case.settings for case in cases}
    return dict(zip(settings, ask_pulses(carsim, list(settings.values())), strict=True))


def _code_hash() -> str:
    digest = hashlib.sha256()
    for package, names in SOURCES:
        folder = Path(package.__path__[0])
        for name in names:
            digest.update((folder / name).read_bytes())
    return digest.hexdigest()
