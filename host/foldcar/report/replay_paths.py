"""Which runs a page replays, and their paths: those that the sweep kept, else simulated again, in several processes.

Input: an experiment's runs, ids of the store, a carsim of the build that simulated the runs. Output: compact paths. A
run that ends otherwise than the stored one is left out and counted: a page must never show another one.
"""

import base64
import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas

from foldcar.car.variation import vary_body
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.compact_path import ROW_BYTES
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.simulation.runner import KEPT_INTERVAL_S, RunRequest, side_by_side
from foldcar.store.frames import RunArrays
from foldcar.store.stored_drives import StoredDrives
from foldcar.study.kept_paths import MOST_BYTES, MOST_RUNS, REPLAYED

CHUNK_RUNS = 64
# Each is a ground on the page.
MOST_SAMPLES = 200
# Runs of designs near this rate of success come first.
THRESHOLD = 0.75

# Design and sample.
Key = tuple[int, int]
# Outcome and time (s).
End = tuple[str, float]


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


def choose_runs(
    runs: RunArrays, kept: Collection[Key] = (), most_bytes: int = MOST_BYTES, most_runs: int = MOST_RUNS
) -> dict[Key, End]:
    """The runs to replay in order of design and sample, of the ``kept`` ones if there are any, and how they ended.

    Each design's first of each ending comes first, then the runs of those designs nearest to THRESHOLD, as many as fit.
    """
    time_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    table = pandas.DataFrame({"design": runs.design, "sample": runs.sample, "outcome": runs.outcome, "time_s": time_s})
    counted = table[table["outcome"] != OUTCOMES.index(REJECTED)]
    success = (counted["outcome"] == OUTCOMES.index("passed")).groupby(counted["design"]).mean()
    table["away"] = (table["design"].map(success) - THRESHOLD).abs()
    table = table[table["outcome"].isin([OUTCOMES.index(name) for name in REPLAYED])]
    if kept:
        table = table[[key in kept for key in zip(table["design"], table["sample"], strict=True)]]
    table["again"] = table.groupby(["design", "outcome"]).cumcount() > 0
    table = table.sort_values(["again", "away", "design", "sample"])
    table = table[table["sample"].isin(table["sample"].unique()[:MOST_SAMPLES])]
    spent = (ROW_BYTES * (2 + table["time_s"] / KEPT_INTERVAL_S)).cumsum()
    chosen = table[spent <= most_bytes][:most_runs].sort_values(["design", "sample"])
    columns = (chosen[name].tolist() for name in ("design", "sample", "outcome", "time_s"))
    return {(design, sample): (OUTCOMES[code], end_s) for design, sample, code, end_s in zip(*columns, strict=True)}


def kept_paths(drives: StoredDrives) -> dict[Key, KeptPath]:
    """The paths that the sweep kept. StoreError."""
    places = {position: place for place, position in enumerate(drives.positions)}
    found = drives.store.kept_paths(drives.experiment)
    return {(places[position], sample): KeptPath(rows, text) for position, sample, rows, text in found}


def simulate_paths(
    drives: StoredDrives,
    chosen: Mapping[Key, End],
    carsim: Carsim,
    jobs: int,
    done: Callable[[int], None] = lambda runs: None,
) -> Paths:
    """The paths of the ``chosen`` runs; ``done`` is told how many runs each chunk had. FoldcarError."""
    found, keys = Paths(), list(chosen)
    chunks = [keys[start : start + CHUNK_RUNS] for start in range(0, len(keys), CHUNK_RUNS)]
    calls = (_run_call(drives, chunk, carsim) for chunk in chunks)
    for chunk, answers in zip(chunks, side_by_side(calls, jobs, carsim.stop), strict=True):
        for key, answer in zip(chunk, answers, strict=True):
            if (answer.get("outcome"), answer.get("elapsed_time_s")) == chosen[key]:
                found.paths[key] = KeptPath(answer["path"]["rows"], answer["path"]["compact"])
            else:
                found.differing.append(key)
        done(len(chunk))
    return found


def _run_call(drives: StoredDrives, chunk: Sequence[Key], carsim: Carsim) -> Callable[[], list[dict[str, Any]]]:
    """A function, for any thread, that simulates these runs with compact paths and returns carsim's answers."""
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
            settings[number] = drives.text("settings", number)
        label = f"design {design + 1}, sample {sample}"
        requests.append(RunRequest(body, f"s{scene}", settings[number], label, sample, True))
    return lambda: carsim.run(bodies, scenes, requests)


def _body(drives: StoredDrives, body: int, variation: int, carsim: Carsim) -> str:
    if not drives.varied or not (differences := drives.value("variation", variation)):
        return drives.text("body", body)
    return json.dumps(vary_body(drives.value("body", body), differences, carsim.limits().numbers))
