"""All that a page needs to replay an experiment's runs, and the trials beside them.

Input: a store, the outcomes of an experiment, a carsim, trials. Output: a JSON object for the page's start, and blobs
that it decodes when they are wanted. A dynamic program drives beside the simulation: its runs cannot be simulated again
from the store, and neither can those of another build.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from foldcar.replay.choice import choose_runs
from foldcar.replay.compact_path import ANGLE_RAD, INTERVAL_S, PLACE_M
from foldcar.replay.ground_maps import HEIGHT_M, ground_maps
from foldcar.replay.outcome_grid import OutcomeGrid
from foldcar.replay.page_blobs import blob
from foldcar.replay.simulate import Key, simulate_paths
from foldcar.replay.stored_drives import StoredDrives, read_drives
from foldcar.replay.trial_paths import trial_path
from foldcar.simulation.carsim import Carsim, ask_pulses
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.tables import TRIAL
from foldcar.store.trial_records import Trial


@dataclass
class Replay:
    """``data`` is the object that the page's program reads, ``blobs`` what it decodes when it is wanted, by name.

    ``remarks`` say which runs cannot be replayed, and why; ``runs`` is how many can.
    """

    data: dict[str, Any]
    blobs: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    runs: int = 0


def no_replay_because(info: ExperimentInfo, drives: StoredDrives, carsim: Carsim | str) -> str | None:
    """Why the runs of an experiment cannot be simulated again; None if they can. ``carsim`` may be the reason itself."""
    if isinstance(carsim, str):
        return carsim
    if carsim.build != info.carsim_build:
        return (
            f"the runs are of carsim build {info.carsim_build}, and the one here is {carsim.build}: it may end them "
            "otherwise. Sweep again, or report with the other build"
        )
    if drives.dynamic is not False:
        how = "runs beside the simulation" if drives.dynamic else "may run beside the simulation: the store does not say"
        return f"{info.scenic_program} {how}, and a replay is of the simulator alone"
    return None


def make_replay(
    store: Store,
    info: ExperimentInfo,
    grid: OutcomeGrid,
    trials: Sequence[Trial],
    carsim: Carsim | str,
    jobs: int,
    done: Callable[[int], None] = lambda steps: None,
    plan: Callable[[int], None] = lambda steps: None,
) -> Replay:
    """The replay of ``info``'s runs; ``plan`` is told how many steps there are, ``done`` how many are done. FoldcarError.

    ``carsim``: the simulator, or the reason why there is none.
    """
    drives = read_drives(store, info.id)
    designs, samples = grid.shown_designs(), grid.shown_samples()
    replay = Replay(
        {
            "places": {design: place for place, design in enumerate(designs)},
            "units": {"place_m": PLACE_M, "angle_rad": ANGLE_RAD, "height_m": HEIGHT_M, "interval_s": INTERVAL_S},
        }
    )
    if len(designs) < len(grid.designs) or len(samples) < grid.samples:
        replay.remarks.append(
            f"{len(designs)} of {len(grid.designs)} designs and {len(samples)} of {grid.samples} environments are shown, "
            "among them the first of each design that ended in each way."
        )
    reason = no_replay_because(info, drives, carsim)
    if reason is not None:
        replay.remarks.append(f"No replay: {reason}.")
        return replay
    assert not isinstance(carsim, str)
    chosen = choose_runs(grid)
    if not chosen and grid.outcomes.any():
        replay.remarks.append("No replay: no run ended in the simulator's own way, so that none has a path.")
    plan(len(chosen) + len({sample for _, sample in chosen}))
    places = {design: place for place, design in enumerate(designs)}
    _add_paths(replay, drives, grid, chosen, places, carsim, jobs, done)
    _add_scenes(replay, drives, sorted({sample for _, sample in chosen}), carsim, jobs, done)
    replay.data["cars"] = _cars(drives, sorted({design for design, _ in chosen}), places, carsim)
    here = _trials_here(store, info, drives)
    loose = sum(trial.sample is None or trial.id not in here for trial in trials)
    if loose:
        replay.remarks.append(
            f"{loose} of {len(trials)} trials name no environment of these runs: they are laid over none of them."
        )
    replay.data["trials"] = [_trial(store, replay, grid, designs, trial, trial.id in here) for trial in trials]
    return replay


def _trials_here(store: Store, info: ExperimentInfo, drives: StoredDrives) -> set[int]:
    """The trials that were driven in the environment of the runs, or by chance in the very same scene."""
    rows = store.rows(TRIAL, "WHERE experiment = ? AND scene_id IS NOT NULL", info.id)
    there = {row["id"] for row in rows if drives.scenes.get(row["sample"]) == row["scene_id"]}
    return store.trials_here(info) | there


def _add_paths(
    replay: Replay,
    drives: StoredDrives,
    grid: OutcomeGrid,
    chosen: Sequence[Key],
    places: Mapping[int, int],
    carsim: Carsim,
    jobs: int,
    done: Callable[[int], None],
) -> None:
    paths = simulate_paths(drives, grid, chosen, carsim, jobs, done)
    by_design: dict[int, list[Key]] = {}
    for key in paths.paths:
        by_design.setdefault(key[0], []).append(key)
    for design, keys in by_design.items():
        hinges = len(drives.value("body", drives.bodies[design])["hinges"])
        runs = [[sample, paths.rows[design, sample], float(grid.elapsed_s[design, sample])] for _, sample in keys]
        content = b"".join(paths.paths[key] for key in keys)
        replay.blobs[f"runs-{places[design]}"] = blob({"hinges": hinges, "runs": runs}, content)
    replay.runs = len(paths.paths)
    shown = int((grid.outcomes[list(places)][:, grid.shown_samples()] > 0).sum())
    if paths.differing:
        replay.remarks.append(
            f"{len(paths.differing)} runs end otherwise when they are simulated again, which must not be: they have no "
            "replay. Was the store made on another processor?"
        )
    if len(chosen) < shown:
        replay.remarks.append(
            f"{replay.runs} of the {shown} runs shown can be replayed: every design's first of each ending, then the "
            "designs nearest to 75 % success, as many as fit into the page and half a minute of simulation."
        )


def _add_scenes(
    replay: Replay,
    drives: StoredDrives,
    samples: Sequence[int],
    carsim: Carsim,
    jobs: int,
    done: Callable[[int], None],
) -> None:
    if not samples:
        return
    scenes = [drives.value("scene", drives.scenes[sample]) for sample in samples]
    ground = ground_maps(scenes, carsim, jobs, done)
    for sample, scene, height_map in zip(samples, scenes, ground.maps, strict=True):
        replay.blobs[f"scene-{sample}"] = blob(scene, height_map or b"")
    replay.data["ground"] = {
        "x_min_m": ground.extent.x_min_m,
        "y_min_m": ground.extent.y_min_m,
        "cell_m": ground.cell_m,
        "columns": ground.columns,
        "rows": ground.rows,
    }


def _cars(
    drives: StoredDrives, designs: Sequence[int], places: Mapping[int, int], carsim: Carsim
) -> list[dict[str, Any] | None]:
    """What is drawn of each design shown, and the firmware's pulses, which follow from the settings; None: no replay."""
    settings = {drives.settings[design]: drives.value("settings", drives.settings[design]) for design in designs}
    trains = dict(zip(settings, ask_pulses(carsim, list(settings.values())), strict=True)) if settings else {}
    cars: list[dict[str, Any] | None] = [None] * len(places)
    for design in designs:
        body = drives.value("body", drives.bodies[design])
        train = trains[drives.settings[design]]
        wheels = _of(body["wheels"], "channel", "segment", "side", "x_m", "radius_m", "width_m")
        servos = [_of([wheel["servo"]], "neutral_us", "direction")[0] for wheel in body["wheels"]]
        cars[places[design]] = {
            "track_m": body["track_m"],
            "segments": _of(body["segments"], "x_m", "length_m", "width_m", "height_m", "center_z_m"),
            "hinges": _of(body["hinges"], "x_m", "z_m"),
            "wheels": [{**wheel, **servo} for wheel, servo in zip(wheels, servos, strict=True)],
            "pulses": [[time_s, *widths] for time_s, widths in zip(train.times_s, train.widths_us, strict=True)],
        }
    return cars


def _of(rows: Sequence[Mapping[str, Any]], *names: str) -> list[dict[str, Any]]:
    return [{name: row[name] for name in names} for row in rows]


def _trial(
    store: Store, replay: Replay, grid: OutcomeGrid, designs: Sequence[int], trial: Trial, here: bool
) -> dict[str, Any]:
    """A trial as the page lists it, beside a run if it was driven ``here``; its path is a blob of its own."""
    design = next((at for at, place in enumerate(designs) if dict(grid.designs[place]) == dict(trial.design)), None)
    found = trial_path(store, trial)
    if found.path is not None:
        head = {"hinges": 0, "runs": [[0, found.rows, found.end_s]]}
        replay.blobs[f"trial-{trial.id}"] = blob(head, found.path)
    return {
        "id": trial.id,
        "car": trial.standing,
        "outcome": trial.outcome,
        "design": design,
        "sample": trial.sample if here else None,
        "moved": len(trial.deviations),
        "path": found.path is not None,
        "attitude": found.attitude,
        "missing": found.missing,
    }
