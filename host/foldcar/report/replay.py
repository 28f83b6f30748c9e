"""Add the replay of an experiment's runs and trials to a page.

Input: an experiment of a store, a carsim. Output: rows of the page's data, and blobs that the page decodes on demand.
``runs-DESIGN`` has the paths of a design, ``car-DESIGN`` its drawing, made of ``pieces``, ``scene-ENVIRONMENT`` a ground,
``trial-NUMBER`` the path of a trial.

The sweep may have kept the paths. Otherwise the runs are simulated again, which is impossible for another build of carsim
and for a Scenic program that runs beside the simulation. A run that ends differently from the stored one is left out and
counted, because a page must never show another run.
"""

import base64
import json
import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import pandas

from foldcar.car.design import compose_columns
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.scene_shape import SceneShapes, drawn_body
from foldcar.figures.scene_data import ground_data
from foldcar.report.page_data import Experiment
from foldcar.simulation.carsim import Carsim, ask_pulses
from foldcar.simulation.compact_path import ANGLE_RAD, PLACE_M, ROW_BYTES
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.results import NUMBERS, OUTCOMES, REJECTED
from foldcar.simulation.runner import KEPT_INTERVAL_S, RunRequest, side_by_side
from foldcar.store.frames import RunArrays
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import StoredDrives, read_drives
from foldcar.store.trial_paths import trial_path
from foldcar.store.trial_records import Trial
from foldcar.study.kept_paths import MAX_BYTES, MAX_RUNS, REPLAYED

CHUNK_RUNS = 64
# Each sample is a ground on the page.
MAX_SAMPLES = 200
# Runs of designs with a rate near this come first.
THRESHOLD = 0.75

# Design and sample.
Key = tuple[int, int]
# Outcome and time (s).
End = tuple[str, float]


@dataclass(frozen=True)
class KeptPath:
    """A compact path (docs/carsim.md) with its number of rows, in base64."""

    rows: int
    text: str

    @property
    def content(self) -> bytes:
        """The decoded bytes."""
        return base64.b64decode(self.text)


@dataclass
class Paths:
    """Paths by (design, sample); ``differing`` runs did not end as stored."""

    paths: dict[Key, KeptPath] = field(default_factory=dict)
    differing: list[Key] = field(default_factory=list)


def choose_runs(
    runs: RunArrays, kept: Collection[Key] = (), most_bytes: int = MAX_BYTES, most_runs: int = MAX_RUNS
) -> dict[Key, End]:
    """Choose the runs to replay, only ``kept`` ones if there are any; return their ends in order of design and sample.

    Each design's first run of each outcome is preferred, then runs of the designs nearest to THRESHOLD, as many as fit.
    """
    time_s = runs.metrics[:, NUMBERS.index("elapsed_time_s")]
    table = pandas.DataFrame({"design": runs.design, "sample": runs.sample, "outcome": runs.outcome, "time_s": time_s})
    counted = table[table["outcome"] != OUTCOMES.index(REJECTED)]
    success = (counted["outcome"] == OUTCOMES.index("passed")).groupby(counted["design"]).mean()
    table["distance"] = (table["design"].map(success) - THRESHOLD).abs()
    table = table[table["outcome"].isin([OUTCOMES.index(name) for name in REPLAYED])]
    if kept:
        table = table[[key in kept for key in zip(table["design"], table["sample"], strict=True)]]
    table["repeated"] = table.groupby(["design", "outcome"]).cumcount() > 0
    table = table.sort_values(["repeated", "distance", "design", "sample"])
    table = table[table["sample"].isin(table["sample"].unique()[:MAX_SAMPLES])]
    spent = (ROW_BYTES * (2 + table["time_s"] / KEPT_INTERVAL_S)).cumsum()
    chosen = table[spent <= most_bytes][:most_runs].sort_values(["design", "sample"])
    columns = (chosen[name].tolist() for name in ("design", "sample", "outcome", "time_s"))
    return {(design, sample): (OUTCOMES[code], end_s) for design, sample, code, end_s in zip(*columns, strict=True)}


def kept_paths(drives: StoredDrives) -> dict[Key, KeptPath]:
    """Return the paths that the sweep kept. Raises StoreError."""
    index_of_position = {position: index for index, position in enumerate(drives.positions)}
    rows = drives.store.kept_paths(drives.experiment)
    return {(index_of_position[position], sample): KeptPath(rows, text) for position, sample, rows, text in rows}


def simulate_paths(
    drives: StoredDrives,
    chosen: Mapping[Key, End],
    carsim: Carsim,
    jobs: int,
    done: Callable[[int], None] = lambda runs: None,
) -> Paths:
    """Simulate the paths of the ``chosen`` runs; call ``done`` with the number of runs of each chunk.

    Raises FoldcarError if the simulator breaks down.
    """
    paths, keys = Paths(), list(chosen)
    chunks = [keys[start : start + CHUNK_RUNS] for start in range(0, len(keys), CHUNK_RUNS)]
    calls = (_run_call(drives, chunk, carsim) for chunk in chunks)
    for chunk, answers in zip(chunks, side_by_side(calls, jobs, carsim.stop), strict=True):
        for key, answer in zip(chunk, answers, strict=True):
            if (answer.get("outcome"), answer.get("elapsed_time_s")) == chosen[key]:
                paths.paths[key] = KeptPath(answer["path"]["rows"], answer["path"]["compact"])
            else:
                paths.differing.append(key)
        done(len(chunk))
    return paths


def _run_call(drives: StoredDrives, chunk: Sequence[Key], carsim: Carsim) -> Callable[[], list[dict[str, Any]]]:
    """Return a function, for any thread, that simulates these runs with compact paths and returns carsim's answers."""
    bodies: dict[str, str] = {}
    scenes: dict[str, str] = {}
    settings: dict[int, str] = {}
    requests = []
    for design, sample in chunk:
        variation, scene = drives.variations[sample], drives.scenes[sample]
        body = f"b{drives.bodies[design]}"
        bodies.setdefault(body, drives.text("body", drives.bodies[design]))
        if f"s{scene}" not in scenes:
            scenes[f"s{scene}"] = drives.text("scene", scene)
        number = drives.settings[design]
        if number not in settings:
            settings[number] = drives.text("settings", number)
        label = f"design {design + 1}, sample {sample}"
        requests.append(
            RunRequest(body, f"s{scene}", settings[number], label, sample, drives.text("variation", variation), True)
        )
    return lambda: carsim.run(bodies, scenes, requests)


UNITS = {"place_m": PLACE_M, "angle_rad": ANGLE_RAD, "interval_s": KEPT_INTERVAL_S}

Blobs = dict[str, str]


@dataclass(frozen=True)
class Replayer:
    """Adds replays to a page.

    ``carsim`` returns the simulator with an engine, or why it is missing. ``plan`` and ``done`` get numbers of steps.
    """

    carsim: Callable[[str], Carsim | str]
    jobs: int = 1
    plan: Callable[[int], None] = lambda steps: None
    done: Callable[[int], None] = lambda steps: None

    def add(self, store: Store, experiment: Experiment, shown: dict[str, Any], key: str) -> Blobs:
        """Add the replay of an experiment to its data ``shown``; return its blobs by their ids, which begin with ``key``.

        Raises FoldcarError if the simulator breaks down.
        """
        if not experiment.evidence.swept:
            return {}
        info, runs, remarks = experiment.info, experiment.evidence.runs, shown["remarks"]
        carsim, drives = self.carsim(info.engine), read_drives(store, info.id)
        kept = kept_paths(drives)
        reason = no_replay_because(info, drives, carsim, bool(kept))
        chosen = choose_runs(runs, kept) if reason is None else {}
        if reason is None and not chosen and len(runs.design):
            reason = "no run ended in the simulator's own way, so that none has a path"
        if reason is not None:
            remarks.append(f"No replay: {reason}.")
        if not chosen:
            return {}
        assert not isinstance(carsim, str)
        samples, designs = ({pair[place] for pair in chosen} for place in (1, 0))
        self.plan(len(chosen) + len(samples))
        if kept:
            paths = Paths({pair: kept[pair] for pair in chosen})
            self.done(len(chosen))
        else:
            paths = simulate_paths(drives, chosen, carsim, self.jobs, self.done)
        blobs = _path_blobs(drives, paths, chosen)
        blobs |= self._scene_blobs(drives, sorted(samples), carsim)
        blobs |= _car_blobs(info, drives, sorted(designs), carsim)
        shown["replays"] = [
            {"design": design, "environment": sample, "outcome": chosen[design, sample][0], "blob": f"runs-{design}"}
            for design, sample in paths.paths
        ]
        if paths.differing:
            remarks.append(
                f"{len(paths.differing)} runs end otherwise when they are simulated again, which must not be: they have "
                "no replay. Was the store made on another processor?"
            )
        if len(chosen) < len(runs.design):
            remarks.append(
                f"{len(paths.paths)} of the {len(runs.design)} runs can be replayed: every design's first of each "
                "ending, then the designs nearest to 75 % success, as many as fit into the page."
            )
        unplaced = sum(row["environment"] is None for row in shown["trials"])
        if unplaced:
            remarks.append(
                f"{unplaced} of {len(experiment.trials)} trials do not say in which sampled environment they were "
                "driven, so they cannot be shown on individual runs."
            )
        for row, trial in zip(shown["trials"], experiment.trials, strict=True):
            row["replay"] = _trial(store, blobs, trial)
        shown["replay"] = {"key": key, "units": UNITS}
        return {f"{key}-{name}": text for name, text in blobs.items()}

    def _scene_blobs(self, drives: StoredDrives, samples: Sequence[int], carsim: Carsim) -> Blobs:
        """Return the ground of each sample; samples with the same scene, as of a fixed course, have it computed once."""
        heights, blobs = carsim_heights(carsim), {}
        texts = {drives.scenes[sample]: drives.value("scene", drives.scenes[sample]) for sample in samples}
        calls = (partial(ground_data, scene, heights, len(texts)) for scene in texts.values())
        made = dict(zip(texts, (blob(*call) for call in side_by_side(calls, self.jobs, carsim.stop)), strict=True))
        for sample in samples:
            blobs[f"scene-{sample}"] = made[drives.scenes[sample]]
            self.done(1)
        return blobs


def no_replay_because(info: ExperimentInfo, drives: StoredDrives, carsim: Carsim | str, kept: bool) -> str | None:
    """Return why the runs of an experiment cannot be replayed; None if paths are ``kept`` or can be simulated again.

    ``carsim`` is the simulator, or why it is missing.
    """
    if isinstance(carsim, str):
        return carsim
    if kept:
        return None
    if carsim.build != info.carsim_build:
        return (
            f"the runs are of carsim build {info.carsim_build}, and the one here is {carsim.build}: it may end them "
            "otherwise. Sweep again, or report with the other build"
        )
    if drives.dynamic is not False:
        how = "runs beside the simulation" if drives.dynamic else "may run beside the simulation: the store does not say"
        return f"{info.scenic_program} {how}, and a replay is of the simulator alone"
    return None


def _path_blobs(drives: StoredDrives, paths: Paths, chosen: Mapping[Key, End]) -> Blobs:
    """Return the paths of each design as one blob."""
    by_design: dict[int, list[Key]] = {}
    for key in paths.paths:
        by_design.setdefault(key[0], []).append(key)
    blobs = {}
    for design, keys in by_design.items():
        hinges = len(drives.value("body", drives.bodies[design])["hinges"])
        runs = [[key[1], paths.paths[key].rows, chosen[key][1]] for key in keys]
        content = b"".join(paths.paths[key].content for key in keys)
        blobs[f"runs-{design}"] = blob({"hinges": hinges, "runs": runs}, content)
    return blobs


def _car_blobs(info: ExperimentInfo, drives: StoredDrives, designs: Sequence[int], carsim: Carsim) -> Blobs:
    """Return the drawing of each design with the firmware's pulses, which follow from the settings."""
    settings = {drives.settings[design]: drives.value("settings", drives.settings[design]) for design in designs}
    same = carsim.build == info.carsim_build
    trains = dict(zip(settings, ask_pulses(carsim, list(settings.values())), strict=True)) if settings and same else {}
    shapes, blobs = SceneShapes(), {}
    for design in designs:
        train = trains.get(drives.settings[design])
        changes = zip(train.times_s, train.widths_us, strict=True) if train else ()
        pulses = [[time_s, *widths] for time_s, widths in changes]
        body = drawn_body(drives.value("body", drives.bodies[design]))
        parts = _parts(info, drives.parameters[design], shapes)
        blobs[f"car-{design}"] = blob({"body": body, "parts": parts, "pulses": pulses})
    return {**blobs, "pieces": blob(shapes.pieces)}


def _parts(info: ExperimentInfo, parameters: Mapping[str, Any], shapes: SceneShapes) -> list[dict[str, Any]] | None:
    """Return the folded car's parts; None if this foldcar cannot fold it, and the page shows its body's boxes."""
    try:
        return shapes.add(folded_car(compose_columns(info.vehicle_type, parameters)))
    except (FoldcarError, ValueError):
        return None


def _trial(store: Store, blobs: Blobs, trial: Trial) -> dict[str, Any]:
    """Return the drawing data of a trial, and add its path to ``blobs``."""
    stored = trial_path(store, trial)
    if stored.path is not None:
        head = {"hinges": 0, "runs": [[0, stored.rows, stored.end_s]]}
        blobs[f"trial-{trial.id}"] = blob(head, stored.path)
    return {
        "moved": len(trial.deviations),
        "path": stored.path is not None,
        "attitude": stored.attitude,
        "missing": stored.missing,
        "film_error": stored.film_error,
    }


def blob(head: Any, content: bytes = b"") -> str:
    """Encode ``head`` as JSON, a line feed and ``content``, as text that is safe inside any HTML element."""
    deflater = zlib.compressobj(9, wbits=-15)
    plain_bytes = json.dumps(head, separators=(",", ":"), allow_nan=False).encode() + b"\n" + content
    return base64.b64encode(deflater.compress(plain_bytes) + deflater.flush()).decode()
