"""All that a page needs to replay an experiment's runs, and the trials beside them.

Input: a store, the outcomes of an experiment, a carsim, trials. Output: a JSON object for the page's start, and blobs
that it decodes when they are wanted. A dynamic program drives beside the simulation: its runs cannot be simulated again
from the store, and neither can those of another build.
"""

import base64
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from foldcar.car.design import compose, parameters
from foldcar.car.folded_car import folded_car
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.recorded_run import drawn_body
from foldcar.fabrication.assembly.scene_shape import SceneShapes
from foldcar.figures.scene_data import ground_data
from foldcar.report.replay_choice import OutcomeGrid, choose_runs
from foldcar.report.replay_paths import Key, Paths, kept_paths, simulate_paths
from foldcar.simulation.carsim import Carsim, ask_pulses
from foldcar.simulation.compact_path import ANGLE_RAD, PLACE_M
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.runner import KEPT_INTERVAL_S, side_by_side
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import StoredDrives, read_drives
from foldcar.store.tables import TRIAL
from foldcar.store.trial_paths import trial_path
from foldcar.store.trial_records import Trial

# Of a compact path.
UNITS = {"place_m": PLACE_M, "angle_rad": ANGLE_RAD, "interval_s": KEPT_INTERVAL_S}


@dataclass
class Replay:
    """``blobs`` are what the page decodes when it is wanted, by name.

    ``runs`` are the rows of page_data.py's ``replays``, ``trials`` the trials that can be laid over runs. A blob
    ``runs-DESIGN`` has the paths of a design, ``car-DESIGN`` what is drawn of it, made of ``pieces``,
    ``scene-ENVIRONMENT`` a ground, ``trial-NUMBER`` the path of a trial; designs are counted as in the experiment.
    ``remarks`` say which runs cannot be replayed, and why.
    """

    blobs: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    runs: list[dict[str, Any]] = field(default_factory=list)
    trials: list[dict[str, Any]] = field(default_factory=list)


def no_replay_because(info: ExperimentInfo, drives: StoredDrives, carsim: Carsim | str, kept: bool) -> str | None:
    """Why the runs of an experiment cannot be replayed; None if they can: paths are ``kept``, or can be simulated again.

    ``carsim`` may be the reason itself.
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


@dataclass(frozen=True)
class Replayer:
    """``carsim`` gives the simulator with an engine, or why there is none; ``plan`` and ``done`` hear of steps."""

    carsim: Callable[[str], Carsim | str]
    jobs: int = 1
    plan: Callable[[int], None] = lambda steps: None
    done: Callable[[int], None] = lambda steps: None

    def replay(self, store: Store, info: ExperimentInfo, grid: OutcomeGrid, trials: Sequence[Trial]) -> Replay:
        """The replay of an experiment's runs. FoldcarError if the simulator breaks down."""
        carsim, jobs, done = self.carsim(info.engine), self.jobs, self.done
        drives = read_drives(store, info.id)
        designs, samples = grid.shown_designs(), grid.shown_samples()
        replay = Replay()
        if len(designs) < len(grid.designs) or len(samples) < grid.samples:
            replay.remarks.append(
                f"{len(designs)} of {len(grid.designs)} designs and {len(samples)} of {grid.samples} environments are "
                "shown, among them the first of each design that ended in each way."
            )
        kept = kept_paths(drives)
        reason = no_replay_because(info, drives, carsim, bool(kept))
        if reason is not None:
            replay.remarks.append(f"No replay: {reason}.")
            return replay
        assert not isinstance(carsim, str)
        chosen = choose_runs(grid, kept or None)
        if not chosen and grid.outcomes.any():
            replay.remarks.append("No replay: no run ended in the simulator's own way, so that none has a path.")
        self.plan(len(chosen) + len({sample for _, sample in chosen}))
        if kept:
            paths = Paths({key: kept[key] for key in chosen})
            done(len(chosen))
        else:
            paths = simulate_paths(drives, grid, chosen, carsim, jobs, done)
        _add_paths(replay, drives, grid, paths, len(chosen))
        _add_scenes(replay, drives, sorted({sample for _, sample in chosen}), carsim, jobs, done)
        _add_cars(replay, info, drives, sorted({design for design, _ in chosen}), carsim)
        here = _trials_here(store, info, drives)
        loose = sum(trial.sample is None or trial.id not in here for trial in trials)
        if loose:
            replay.remarks.append(
                f"{loose} of {len(trials)} trials name no environment of these runs: they are laid over none of them."
            )
        replay.trials = [_trial(store, replay, grid, trial, trial.id in here) for trial in trials]
        return replay


def _trials_here(store: Store, info: ExperimentInfo, drives: StoredDrives) -> set[int]:
    """The trials that were driven in the environment of the runs, or by chance in the very same scene."""
    rows = store.rows(TRIAL, "WHERE experiment = ? AND scene_id IS NOT NULL", info.id)
    there = {row["id"] for row in rows if drives.scenes.get(row["sample"]) == row["scene_id"]}
    return store.trials_here(info) | there


def _add_paths(replay: Replay, drives: StoredDrives, grid: OutcomeGrid, paths: Paths, chosen: int) -> None:
    by_design: dict[int, list[Key]] = {}
    for key in paths.paths:
        by_design.setdefault(key[0], []).append(key)
    for design, keys in by_design.items():
        hinges = len(drives.value("body", drives.bodies[design])["hinges"])
        runs = [[sample, paths.paths[design, sample].rows, float(grid.elapsed_s[design, sample])] for _, sample in keys]
        content = b"".join(paths.paths[key].content for key in keys)
        replay.blobs[f"runs-{design}"] = blob({"hinges": hinges, "runs": runs}, content)
        replay.runs += [
            {"design": design, "environment": sample, "outcome": grid.outcome(design, sample), "blob": f"runs-{design}"}
            for _, sample in keys
        ]
    shown = int((grid.outcomes[grid.shown_designs()][:, grid.shown_samples()] > 0).sum())
    if paths.differing:
        replay.remarks.append(
            f"{len(paths.differing)} runs end otherwise when they are simulated again, which must not be: they have no "
            "replay. Was the store made on another processor?"
        )
    if chosen < shown:
        replay.remarks.append(
            f"{len(replay.runs)} of the {shown} runs shown can be replayed: every design's first of each ending, then "
            "the designs nearest to 75 % success, as many as fit into the page."
        )


def _add_scenes(
    replay: Replay,
    drives: StoredDrives,
    samples: Sequence[int],
    carsim: Carsim,
    jobs: int,
    done: Callable[[int], None],
) -> None:
    """The ground of each sample: samples of one scene, as of a fixed course, have it computed once."""
    heights = carsim_heights(carsim)
    texts = {drives.scenes[sample]: drives.value("scene", drives.scenes[sample]) for sample in samples}
    calls = (partial(ground_data, scene, heights, len(texts)) for scene in texts.values())
    made = dict(zip(texts, (blob(*one) for one in side_by_side(calls, jobs, carsim.stop)), strict=True))
    for sample in samples:
        replay.blobs[f"scene-{sample}"] = made[drives.scenes[sample]]
        done(1)


def _add_cars(replay: Replay, info: ExperimentInfo, drives: StoredDrives, designs: Sequence[int], carsim: Carsim) -> None:
    """What is drawn of each design, and the firmware's pulses, which follow from the settings."""
    settings = {drives.settings[design]: drives.value("settings", drives.settings[design]) for design in designs}
    same = carsim.build == info.carsim_build
    trains = dict(zip(settings, ask_pulses(carsim, list(settings.values())), strict=True)) if settings and same else {}
    keys = {parameter.column: key for key, parameter in parameters().items()}
    shapes = SceneShapes()
    for design in designs:
        train = trains.get(drives.settings[design])
        changes = zip(train.times_s, train.widths_us, strict=True) if train else ()
        pulses = [[time_s, *widths] for time_s, widths in changes]
        body = drawn_body(drives.value("body", drives.bodies[design]))
        head = {"body": body, "parts": _parts(info, drives.parameters[design], keys, shapes), "pulses": pulses}
        replay.blobs[f"car-{design}"] = blob(head)
    replay.blobs["pieces"] = blob(shapes.pieces)


def _parts(
    info: ExperimentInfo, parameters: Mapping[str, Any], keys: Mapping[str, str], shapes: SceneShapes
) -> list[dict[str, Any]] | None:
    """The folded car's parts; None if this foldcar cannot fold it: then the page shows its body's boxes."""
    try:
        design = compose(info.vehicle_type, {keys[name]: float(value) for name, value in parameters.items()})
        return shapes.add(folded_car(design))
    except (FoldcarError, KeyError, ValueError):
        return None


def _trial(store: Store, replay: Replay, grid: OutcomeGrid, trial: Trial, here: bool) -> dict[str, Any]:
    """A trial as the page lists it, beside a run if it was driven ``here``; its path is a blob of its own."""
    design = next((at for at, one in enumerate(grid.designs) if dict(one) == dict(trial.design)), None)
    found = trial_path(store, trial)
    if found.path is not None:
        head = {"hinges": 0, "runs": [[0, found.rows, found.end_s]]}
        replay.blobs[f"trial-{trial.id}"] = blob(head, found.path)
    return {
        "number": trial.id,
        "standing": trial.standing,
        "outcome": trial.outcome,
        "design": design,
        "environment": trial.sample if here else None,
        "moved": len(trial.deviations),
        "path": found.path is not None,
        "attitude": found.attitude,
        "missing": found.missing,
        "film_error": found.film_error,
    }


def blob(head: Any, content: bytes = b"") -> str:
    """``head`` as JSON, a line feed and ``content``, as text that is safe inside any element."""
    deflater = zlib.compressobj(9, wbits=-15)
    whole = json.dumps(head, separators=(",", ":"), allow_nan=False).encode() + b"\n" + content
    return base64.b64encode(deflater.compress(whole) + deflater.flush()).decode()
