"""The paths of stored runs: those that the sweep kept, else simulated again, in several processes.

Input: ids of the store, a carsim of the build that simulated the runs. Output: compact paths. A run that ends otherwise
than the stored one is left out and counted: a page must never show another run than the one that counts.
"""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from foldcar.car.variation import vary_body
from foldcar.report.replay_choice import OutcomeGrid
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest, side_by_side
from foldcar.store.stored_drives import StoredDrives

CHUNK_RUNS = 64

Key = tuple[int, int]


@dataclass(frozen=True)
class KeptPath:
    """A compact path (docs/carsim.md) of so many rows, in base64."""

    rows: int
    text: str

    @property
    def content(self) -> bytes:
        """Its bytes."""
        return base64.b64decode(self.text)


@dataclass
class Paths:
    """Paths by (design, sample); ``differing`` runs did not end as stored."""

    paths: dict[Key, KeptPath] = field(default_factory=dict)
    differing: list[Key] = field(default_factory=list)


def kept_paths(drives: StoredDrives) -> dict[Key, KeptPath]:
    """The paths that the sweep kept. StoreError."""
    places = {position: place for place, position in enumerate(drives.positions)}
    found = drives.store.kept_paths(drives.experiment)
    return {(places[position], sample): KeptPath(rows, text) for position, sample, rows, text in found}


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
    calls = (run_call(drives, chunk, carsim) for chunk in chunks)
    for chunk, answers in zip(chunks, side_by_side(calls, jobs, carsim.stop), strict=True):
        for key, answer in zip(chunk, answers, strict=True):
            if answer.get("outcome") == grid.outcome(*key) and answer.get("elapsed_time_s") == grid.elapsed_s[key]:
                found.paths[key] = KeptPath(answer["path"]["rows"], answer["path"]["compact"])
            else:
                found.differing.append(key)
        done(len(chunk))
    return found


def run_call(
    drives: StoredDrives, chunk: Sequence[Key], carsim: Carsim, interval_s: float | None = None
) -> Callable[[], list[dict[str, Any]]]:
    """A function, for any thread, that simulates these (design, sample) pairs with paths and returns carsim's answers.

    Paths are compact, or have rows each ``interval_s``.
    """
    bodies: dict[str, str] = {}
    scenes: dict[str, str] = {}
    settings: dict[int, str] = {}
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
            text = drives.text("settings", number)
            settings[number] = text if interval_s is None else _with_path(json.loads(text), interval_s)
        label = f"design {design + 1}, sample {sample}"
        requests.append(RunRequest(body, f"s{scene}", settings[number], label, sample, interval_s is None))
    return lambda: carsim.run(bodies, scenes, requests)


def _with_path(settings: Mapping[str, Any], interval_s: float) -> str:
    return json.dumps({**settings, "path_interval_s": interval_s})


def _body(drives: StoredDrives, body: int, variation: int, carsim: Carsim) -> str:
    if not drives.varied or not (differences := drives.value("variation", variation)):
        return drives.text("body", body)
    return json.dumps(vary_body(drives.value("body", body), differences, carsim.limits().numbers))
