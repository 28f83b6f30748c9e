"""The runs of a cross-check that carsim makes, and those that Scenic runs beside either engine.

Input: numbered cases. Output: their numbers and results as they finish. Results are alike for all engines: what
`carsim batch` gives, with the place of the end.
"""

import contextlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import groupby
from typing import Any

from foldcar.crosscheck.cases import Case
from foldcar.crosscheck.mujoco_car import EngineOptions
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import Runner, RunRequest
from foldcar.store.writer import canonical_json

# Runs that one simulator process gets at a time, alone and with Scenic beside it.
CHUNK, CHUNK_BESIDE = 24, 4
MUJOCO_WORKER = "foldcar.crosscheck.mujoco_worker"

Numbered = tuple[int, Case]
Finished = tuple[int, dict[str, Any]]


def run_in_carsim(cases: Sequence[Numbered], carsim: Carsim, jobs: int) -> Iterator[Finished]:
    """Programs that need Scenic get it."""
    alone = [(number, case) for number, case in cases if case.beside is None]
    for number, answer in _in_chunks(alone, carsim, jobs, CHUNK):
        yield number, _without_path(answer)
    for number, answer in _beside_scenic([one for one in cases if one[1].beside is not None], carsim, jobs, {}):
        case = next(case for index, case in cases if index == number)
        if answer["outcome"] != "failed":
            # Beside Scenic there is no path, but the trial is the same.
            (alike,) = ask(carsim, [case], carsim.limits().trial.step_s)
            answer["end"] = path_until(alike["path"], answer["elapsed_time_s"])[-1][1:3]
        yield number, answer


def run_in_mujoco_beside_scenic(
    cases: Sequence[Numbered], carsim: Carsim, jobs: int, options: EngineOptions
) -> Iterator[Finished]:
    """Runs of programs that need Scenic, in MuJoCo."""
    engine = {"timestep_s": options.timestep_s, "tyre": options.tyre}
    yield from _beside_scenic(cases, carsim, jobs, {"worker": MUJOCO_WORKER, "engine": engine})


def ask(runner: Runner, cases: Sequence[Case], interval_s: float = 0.0) -> list[dict[str, Any]]:
    """Answers as they come, with a path; a run that failed is an outcome of its own."""
    bodies = {str(i): canonical_json(case.body) for i, case in enumerate(cases)}
    scenes = {str(i): canonical_json(case.scene) for i, case in enumerate(cases)}
    requests = []
    for i, case in enumerate(cases):
        # A path always has the end; one interval as long as the run has little else.
        settings = {**case.settings, "path_interval_s": interval_s or case.settings["time_limit_s"]}
        requests.append(RunRequest(str(i), str(i), canonical_json(settings), case.label, case.sample))
    return [
        {"outcome": "failed", "message": answer["error"]}
        if "error" in answer
        else {key: value for key, value in answer.items() if key != "recorded"}
        for answer in runner.run(bodies, scenes, requests)
    ]


def path_until(path: Sequence[Sequence[float]], end_s: float) -> list[Sequence[float]]:
    """The rows of a path up to a time, at least the first."""
    return [row for row in path if row[0] <= end_s + 1e-6] or list(path[:1])


def _beside_scenic(
    cases: Sequence[Numbered], carsim: Carsim, jobs: int, options: Mapping[str, Any]
) -> Iterator[Finished]:
    for environment, group in groupby(cases, key=lambda numbered: numbered[1].beside):
        assert environment is not None
        with contextlib.closing(environment.scenic_runner(carsim, **options)) as runner:
            yield from _in_chunks(list(group), runner, jobs, CHUNK_BESIDE)


def _in_chunks(cases: Sequence[Numbered], runner: Runner, jobs: int, size: int) -> Iterator[Finished]:
    chunks = [cases[start : start + size] for start in range(0, len(cases), size)]
    pool = ThreadPoolExecutor(jobs)
    try:
        answers: Iterable[list[dict[str, Any]]] = pool.map(lambda c: ask(runner, [case for _, case in c]), chunks)
        for chunk, answer in zip(chunks, answers, strict=True):
            for (number, _), result in zip(chunk, answer, strict=True):
                yield number, result
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        runner.stop()


def _without_path(answer: dict[str, Any]) -> dict[str, Any]:
    if answer["outcome"] == "failed":
        return answer
    kept = {key: value for key, value in answer.items() if key != "path"}
    return {**kept, "end": answer["path"][-1][1:3]}
