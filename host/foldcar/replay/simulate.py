"""Simulates stored runs again for their paths, in several processes, and sees whether each ends as the stored one did.

Input: ids of the store, a carsim of the build that simulated the runs. Output: compact paths. A run that ends otherwise
than the stored one is left out and counted: a page must never show another run than the one that counts.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from foldcar.car.variation import vary_body
from foldcar.replay.compact_path import INTERVAL_S, compact_path
from foldcar.replay.outcome_grid import OutcomeGrid
from foldcar.replay.stored_drives import StoredDrives
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest, side_by_side

CHUNK_RUNS = 64

Key = tuple[int, int]


@dataclass
class Paths:
    """Compact paths by (design, sample), their numbers of rows and hinges; ``differing`` runs did not end as stored."""

    paths: dict[Key, bytes] = field(default_factory=dict)
    rows: dict[Key, int] = field(default_factory=dict)
    differing: list[Key] = field(default_factory=list)


def simulate_paths(
    drives: StoredDrives,
    grid: OutcomeGrid,
    chosen: Sequence[Key],
    carsim: Carsim,
    jobs: int,
    done: Callable[[int], None] = lambda runs: None,
) -> Paths:
    """The paths of the ``chosen`` (design, sample) pairs; ``done`` is told how many runs each chunk had. FoldcarError."""
    found = Paths()
    chunks = [chosen[start : start + CHUNK_RUNS] for start in range(0, len(chosen), CHUNK_RUNS)]
    calls = (run_call(drives, chunk, carsim, INTERVAL_S) for chunk in chunks)
    for chunk, answers in zip(chunks, side_by_side(calls, jobs, carsim.stop), strict=True):
        for key, answer in zip(chunk, answers, strict=True):
            _keep(found, grid, key, answer)
        done(len(chunk))
    return found


def run_call(
    drives: StoredDrives, chunk: Sequence[Key], carsim: Carsim, interval_s: float
) -> Callable[[], list[dict[str, Any]]]:
    """A function, for any thread, that simulates these (design, sample) pairs with paths and returns carsim's answers."""
    bodies, scenes, settings = {}, {}, {}
    requests = []
    for design, sample in chunk:
        variation, scene = drives.variations[sample], drives.scenes[sample]
        body = f"b{drives.bodies[design]}v{variation}"
        if body not in bodies:
            bodies[body] = _body(drives, drives.bodies[design], variation, carsim)
        if f"s{scene}" not in scenes:
            scenes[f"s{scene}"] = drives.text("scene", scene)
        number = drives.settings[design]
        if number not in settings:
            settings[number] = json.dumps({**drives.value("settings", number), "path_interval_s": interval_s})
        requests.append(RunRequest(body, f"s{scene}", settings[number], f"design {design + 1}, sample {sample}", sample))
    return lambda: carsim.run(bodies, scenes, requests)


def _body(drives: StoredDrives, body: int, variation: int, carsim: Carsim) -> str:
    if not drives.varied or not (differences := drives.value("variation", variation)):
        return drives.text("body", body)
    return json.dumps(vary_body(drives.value("body", body), differences, carsim.limits().numbers))


def _keep(found: Paths, grid: OutcomeGrid, key: Key, answer: dict[str, Any]) -> None:
    same = answer.get("outcome") == grid.outcome(*key) and answer.get("elapsed_time_s") == grid.elapsed_s[key]
    if not same:
        found.differing.append(key)
        return
    found.paths[key] = compact_path(answer["path"])
    found.rows[key] = len(answer["path"])
