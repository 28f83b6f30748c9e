"""Runs in which two engines part, simulated again in both for their paths; those that end furthest apart.

Input: disagreements of one experiment in a store, the simulators that made them. Output: paths of both. Only the
candidates that differ most in their distance to the target are simulated again, one a scene. A program that runs beside
the simulation may have ended a run before the simulator alone does: the path is cut there.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from foldcar.report.crosscheck_agreement import Case, Pair, passes, stored_name
from foldcar.report.replay_paths import run_call
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import REJECTED
from foldcar.simulation.runner import PATH_INTERVAL_S, side_by_side
from foldcar.store.reader import Store
from foldcar.store.stored_drives import StoredDrives, read_drives

CANDIDATES = 24


@dataclass(frozen=True)
class Parted:
    """A case, its scene, and both results as far as they have been simulated again, with ``path``."""

    case: Case
    scene: Mapping[str, Any]
    first: Mapping[str, Any]
    second: Mapping[str, Any]

    @property
    def apart_m(self) -> float:
        """The distance of the final positions."""
        return math.dist(self.first["path"][-1][1:3], self.second["path"][-1][1:3])


def parted(store: Store, pairs: Sequence[Pair], engines: Mapping[str, Carsim], jobs: int, count: int) -> list[Parted]:
    """At most ``count`` of one experiment's disagreements; ``engines`` are the first's and the second's. FoldcarError."""
    if not pairs:
        return []
    names = [stored_name(pairs[0][0].experiment, engine) for engine in engines]
    drives = [read_drives(store, name) for name in names]
    chosen = _candidates(pairs, drives[0].scenes)
    results = [one for _, one, _ in chosen], [other for _, _, other in chosen]
    sides = [
        _paths(drive, carsim, [case for case, *_ in chosen], known, jobs)
        for drive, carsim, known in zip(drives, engines.values(), results, strict=True)
    ]
    found = []
    for (case, *_), first, second in zip(chosen, *sides, strict=True):
        if first is not None and second is not None:
            found.append(Parted(case, drives[0].value("scene", drives[0].scenes[case.sample]), first, second))
    return sorted(found, key=lambda one: -one.apart_m)[:count]


def _candidates(pairs: Sequence[Pair], scenes: Mapping[int, int]) -> list[Pair]:
    """The disagreements that differ most in the distance to the target, one a scene."""
    without_path = {"failed", REJECTED}
    apart = [p for p in pairs if passes(p[1]) != passes(p[2]) and not without_path & {p[1]["outcome"], p[2]["outcome"]}]
    apart.sort(key=lambda p: -abs((p[1]["distance_to_target_m"] or 0) - (p[2]["distance_to_target_m"] or 0)))
    by_scene: dict[int, Pair] = {}
    for pair in apart:
        by_scene.setdefault(scenes[pair[0].sample], pair)
    return list(by_scene.values())[:CANDIDATES]


def _paths(
    drives: StoredDrives, carsim: Carsim, cases: Sequence[Case], stored: Sequence[Mapping[str, Any]], jobs: int
) -> list[Mapping[str, Any] | None]:
    """The stored results with their paths; None if the run does not end again as it did."""
    size = max(1, -(-len(cases) // jobs))
    keys = [(case.design, case.sample) for case in cases]
    calls = (run_call(drives, keys[i : i + size], carsim, PATH_INTERVAL_S) for i in range(0, len(keys), size))
    answers = [answer for chunk in side_by_side(calls, jobs, carsim.stop) for answer in chunk]
    return [_with_path(one, answer, bool(drives.dynamic)) for one, answer in zip(stored, answers, strict=True)]


def _with_path(stored: Mapping[str, Any], answer: Mapping[str, Any], beside: bool) -> Mapping[str, Any] | None:
    end_s = stored["elapsed_time_s"]
    path = [row for row in answer.get("path", ()) if row[0] <= end_s + 1e-6]
    same = all(answer.get(key) == stored[key] for key in ("outcome", "elapsed_time_s"))
    return {**stored, "path": path} if path and (same or beside) else None
