"""Gives a page all that it needs to simulate the runs of an experiment itself, with carsim.wasm, and to draw them.

Input: an experiment of a store, a native carsim. Output: rows of the page's data, and blobs that the page decodes when
they are needed: ``inputs`` has bodies, settings and realities of the runs, ``pieces`` and ``car-DESIGN`` the shapes of
the cars, ``scene-ENVIRONMENT`` a scene with its ground, ``checks`` a hash of each stored result, ``trial-NUMBER`` the
path of a trial. A page cannot simulate runs of MuJoCo, nor those of a Scenic program that runs beside the simulation.
"""

import base64
import json
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.belief.priors import MAX_SCORE, PARAMETERS
from foldcar.belief.reality import REAL_ONLY, start_deviates
from foldcar.car.folded_car import folded_columns
from foldcar.fabrication.assembly.scene_shape import SceneShapes, drawn_body
from foldcar.figures.scene_data import ground_data
from foldcar.report.page_types import PageExperiment, Slider, TrialReplay
from foldcar.report.reported_experiment import ReportedExperiment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import ENGINES, MUJOCO_ENVIRONMENT, engine_of
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.results import FAILED, OUTCOMES, REJECTED
from foldcar.simulation.runner import PATH_INTERVAL_S, side_by_side
from foldcar.statistics.words import count
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.run_arrays import RunArrays
from foldcar.store.stored_drives import StoredDrives, read_drives
from foldcar.store.trial_paths import trial_path
from foldcar.store.trial_records import Trial

# More designs cannot be told apart on a screen; each environment is a ground on the page.
MAX_DESIGNS, MAX_SAMPLES = 400, 200
# Parameters of the page's sliders. Differences between wheels are those of the runs.
SLIDERS = tuple(parameter for parameter in PARAMETERS if parameter.name != "wheel_spread")
# The largest resistance (Ω) of the supply's slider.
MAX_SUPPLY_OHM = 0.6
FNV_OFFSET, FNV_PRIME = 0x811C9DC5, 0x01000193

# Compressed data of the page by name; see :func:`blob`.
Blobs = dict[str, str]


@dataclass(frozen=True)
class PageDrives:
    """``carsim`` returns the native simulator, or why it is missing; ``plan`` and ``done`` get numbers of steps."""

    carsim: Callable[[str], Carsim | str]
    jobs: int = 1
    plan: Callable[[int], None] = lambda steps: None
    done: Callable[[int], None] = lambda steps: None

    def add(self, store: Store, experiment: ReportedExperiment, shown: PageExperiment, key: str) -> Blobs:
        """Add to an experiment's page data ``shown`` what the page simulates; its blobs' names begin with ``key``.

        Raises FoldcarError if the simulator breaks down.
        """
        if not experiment.evidence.swept:
            return {}
        info, runs = experiment.info, experiment.evidence.runs
        drives = read_drives(store, info.id)
        carsim = self.carsim(info.engine)
        reason = carsim if isinstance(carsim, str) else why_not(info, drives)
        if reason is not None:
            shown["remarks"].append(f"The page cannot simulate: {reason}.")
            return {}
        assert not isinstance(carsim, str)
        if carsim.build != info.carsim_build:
            shown["remarks"].append(
                f"The runs were simulated by another build of foldcar ({info.carsim_build}) than the one in this page "
                f"({carsim.build}), so a run that the page drives may end otherwise."
            )
        designs = _shown_designs(len(drives.bodies), experiment.recommended)
        samples = sorted(drives.scenes)[:MAX_SAMPLES]
        self.plan(len(samples))
        blobs = {"inputs": _inputs(info, drives, designs, samples), "checks": _checks(runs)}
        blobs |= self._scene_blobs(drives, samples, carsim)
        blobs |= _car_blobs(info, drives, designs)
        shown["drives"] = {
            "key": key,
            "engine": " ".join(ENGINES[engine_of(info.engine)].options),
            "build": info.carsim_build,
            "designs": designs,
            "environments": samples,
            "path_interval_s": PATH_INTERVAL_S,
            "sliders": [] if info.under else sliders(),
        }
        if len(designs) < len(drives.bodies) or len(samples) < len(drives.scenes):
            shown["remarks"].append(
                f"The page can simulate {len(designs)} of {count(len(drives.bodies), 'design')} in the first "
                f"{len(samples)} of {count(len(drives.scenes), 'environment')}."
            )
        for row, trial in zip(shown["trials"], experiment.trials, strict=True):
            row["replay"] = _trial(store, blobs, trial)
        return {f"{key}-{name}": text for name, text in blobs.items()}

    def _scene_blobs(self, drives: StoredDrives, samples: Sequence[int], carsim: Carsim) -> Blobs:
        """Return the scene of each sample, with the heights of its ground, as a blob for the page.

        Samples with equal scenes share a scene in the store, whose heights are computed once.
        """
        heights = carsim_heights(carsim)
        scene_ids = dict.fromkeys(drives.scenes[sample] for sample in samples)
        scenes = [drives.value("scene", scene_id) for scene_id in scene_ids]
        calls = (partial(ground_data, scene, heights, len(scenes)) for scene in scenes)
        grounds = side_by_side(calls, self.jobs, carsim.stop)
        blob_by_id = {}
        for scene_id, (head, height_bytes) in zip(scene_ids, grounds, strict=True):
            blob_by_id[scene_id] = blob(head, height_bytes)
        blobs = {}
        for sample in samples:
            blobs[f"scene-{sample}"] = blob_by_id[drives.scenes[sample]]
            self.done(1)
        return blobs


def why_not(info: ExperimentInfo, drives: StoredDrives) -> str | None:
    """Return why a page cannot simulate the runs of an experiment; None if it can.

    A page cannot run a Scenic program that is dynamic, which means that it runs beside the simulation.
    """
    if ENGINES[engine_of(info.engine)].environment == MUJOCO_ENVIRONMENT:
        return "MuJoCo does not run in a page; `foldcar view --run` shows its runs"
    if drives.dynamic is None:
        return f"{info.scenic_program} may run beside the simulation; `foldcar view --run` shows its runs"
    if drives.dynamic:
        return f"{info.scenic_program} runs beside the simulation; `foldcar view --run` shows its runs"
    return None


def sliders() -> list[Slider]:
    """Return the parameters that a page can change, each with its range and its nominal value."""
    rows = []
    for parameter in SLIDERS:
        # The range is that of scores, which are standard deviations of the prior. It must contain the nominal value.
        low = min(float(parameter.value(-MAX_SCORE)), parameter.nominal)
        if parameter.prior == "half-normal":
            # This is a standard deviation, which may be 0.
            low = 0.0
        rows.append(
            _slider(
                name=parameter.name,
                unit=parameter.unit,
                meaning=parameter.meaning,
                nominal=parameter.nominal,
                low=low,
                high=float(parameter.value(MAX_SCORE)),
            )
        )
    # This parameter is not among the unknowns that foldcar draws, but a reality file may contain it.
    supply = REAL_ONLY["supply_resistance_ohm"]
    rows.append(
        _slider(
            name="supply_resistance_ohm",
            unit=supply.unit,
            meaning="resistance of cells, wires and switch of the servo supply, beyond the design's",
            nominal=supply.nominal,
            low=0.0,
            high=MAX_SUPPLY_OHM,
        )
    )
    return rows


def _slider(name: str, unit: str, meaning: str, nominal: float, low: float, high: float) -> Slider:
    """Return a slider of the page, whose range has three digits."""
    return {
        "name": name,
        "unit": unit,
        "meaning": meaning,
        "nominal": nominal,
        "low": float(f"{low:.3g}"),
        "high": float(f"{high:.3g}"),
    }


def _shown_designs(swept: int, recommended: int | None) -> list[int]:
    """Choose the designs that the page can simulate, and return their indices.

    ``swept`` is the number of swept designs, which come first in the family. If there are at most MAX_DESIGNS, all of
    them are chosen. Otherwise MAX_DESIGNS are chosen, evenly spread over the family, and the recommended one.
    """
    if swept <= MAX_DESIGNS:
        return list(range(swept))
    shown = {place * (swept - 1) // (MAX_DESIGNS - 1) for place in range(MAX_DESIGNS)}
    # A recommended design may be one that was only driven. It has no runs that the page could simulate.
    if recommended is not None and recommended < swept:
        shown.add(recommended)
    return sorted(shown)


def _inputs(info: ExperimentInfo, drives: StoredDrives, designs: Sequence[int], samples: Sequence[int]) -> str:
    """Return a blob with the inputs from which the page simulates a run of any of these designs in any of these samples.

    Designs may share a body or settings. So each of these is in the blob once, and each design has its indices among
    them. Each sample has a reality, which is how its built car differs from the design, and the random numbers that place
    the car at the start.
    """
    # The different bodies and settings of the designs, by the numbers of their rows in the store.
    body_ids = list(dict.fromkeys(drives.bodies[design] for design in designs))
    settings_ids = list(dict.fromkeys(drives.settings[design] for design in designs))
    indices_of_design = {}
    for design in designs:
        body_index = body_ids.index(drives.bodies[design])
        settings_index = settings_ids.index(drives.settings[design])
        indices_of_design[design] = [body_index, settings_index]
    realities, start_numbers = {}, {}
    for sample in samples:
        realities[sample] = drives.value("variation", drives.variations[sample]) if drives.varied else {}
        start_numbers[sample] = start_deviates(info.variation_seed, sample)
    return blob(
        {
            "bodies": [drives.value("body", body_id) for body_id in body_ids],
            "settings": [drives.value("settings", settings_id) for settings_id in settings_ids],
            "designs": indices_of_design,
            "realities": realities,
            "deviates": start_numbers,
        }
    )


def _checks(runs: RunArrays) -> str:
    """Return a blob with a hash for each run, by which the page checks a run that it has simulated again.

    It is the 32-bit FNV-1a hash of the run's outcome and metrics. It is 0 for a rejected or failed run, because the page
    cannot repeat what ended it.
    """
    hashes = result_hashes(runs.outcome, runs.metrics)
    for name in (REJECTED, FAILED):
        hashes[runs.outcome == OUTCOMES.index(name)] = 0
    return blob({"runs": len(hashes)}, hashes.astype("<u4").tobytes())


def result_hashes(outcome: NDArray[Any], metrics: NDArray[Any]) -> NDArray[Any]:
    """Return a hash (n,) of each run's outcome and metrics. The page's script drives.js computes the same hashes.

    ``outcome`` (n,) has the outcomes as numbers, and ``metrics`` (n, k) the metrics. A hash is the 32-bit FNV-1a hash of
    the bytes of both.
    """
    # NaN has many bit patterns; here it has one.
    numbers = numpy.where(numpy.isnan(metrics), numpy.nan, metrics).astype("<f8")
    bytes_of_numbers = numbers.view(numpy.uint8).reshape(len(numbers), -1)
    # A row of bytes for each run.
    bytes_of_runs = numpy.column_stack([outcome.astype(numpy.uint8), bytes_of_numbers])
    hashes = numpy.full(len(bytes_of_runs), FNV_OFFSET, dtype=numpy.uint32)
    for byte_of_each_run in bytes_of_runs.T:
        hashes = (hashes ^ byte_of_each_run) * numpy.uint32(FNV_PRIME)
    return hashes


def _car_blobs(info: ExperimentInfo, drives: StoredDrives, designs: Sequence[int]) -> Blobs:
    """Return the shapes of each design's car for the page, and the pieces that cars share, as blobs.

    A blob is a compressed text, which the page decodes when it is needed.
    """
    shapes = SceneShapes()
    blobs = {}
    for design in designs:
        car = folded_columns(info.vehicle_type, drives.parameters[design])
        # If this version of foldcar cannot fold the car, the page shows the boxes of the body instead of parts.
        parts = None if car is None else shapes.add(car)
        body = drawn_body(drives.value("body", drives.bodies[design]))
        blobs[f"car-{design}"] = blob({"body": body, "parts": parts})
    blobs["pieces"] = blob(shapes.pieces)
    return blobs


def _trial(store: Store, blobs: Blobs, trial: Trial) -> TrialReplay:
    """Return what the page needs to show how a trial's car moved. The path itself is added to the ``blobs``.

    ``moved`` is how many objects stood elsewhere than in the sampled environment. A trial whose log has no path may have
    an ``attitude``, rows of the car's angles. ``missing`` says why a trial has neither.
    """
    path = trial_path(store, trial)
    if path.rows is not None:
        blobs[f"trial-{trial.id}"] = blob(path.rows.round(4).tolist())
    return {
        "moved": len(trial.deviations),
        "path": path.rows is not None,
        "attitude": None if path.attitude is None else [list(row) for row in path.attitude],
        "missing": path.missing,
    }


def blob(head: Any, content: bytes = b"") -> str:
    """Return ``head`` as JSON, a line feed and ``content``, deflated, as text that is safe inside any element."""
    head_json = json.dumps(head, separators=(",", ":"), allow_nan=False)
    return deflated(head_json.encode() + b"\n" + content)


def deflated(content: bytes) -> str:
    """Return bytes as a page's ``inflate`` reads them: deflated without header, in base64."""
    deflater = zlib.compressobj(9, wbits=-15)
    return base64.b64encode(deflater.compress(content) + deflater.flush()).decode()
