"""A file of what a simulated car and its ground differ in from what the host believes, for trials whose truth is known.

Input: a JSON object of parameters of :mod:`foldcar.calibration.parameters`; those that it leaves out keep the simulator's
nominal values. Output: the true body and scene of a run. FoldcarError names file and key.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from foldcar.calibration.effects import calibrated_scene, calibrated_variation
from foldcar.calibration.parameters import NOMINAL, PARAMETERS
from foldcar.car.variation import NumberLimits, vary_body
from foldcar.did_you_mean import did_you_mean
from foldcar.errors import FoldcarError
from foldcar.store.calibrations import Calibration
from foldcar.store.info import REALITY_KIND
from foldcar.study.experiments import Experiment
from foldcar.study.listing_file import load_listing

# Beyond these scores the priors have no mass that matters, and the simulator's limits come near.
MOST_SCORE = 6.0

# Of the hash of the values, in a reality's name.
NAME_DIGITS = 8


def read_reality(file: Path) -> dict[str, float]:
    """All parameters by name, those of ``file`` and the nominal values of the others."""
    data, _ = load_listing(file)
    if not isinstance(data, Mapping):
        raise FoldcarError(f"{file}: is not a JSON object of parameters, as docs/calibration.md has them")
    known = {parameter.name: parameter for parameter in PARAMETERS}
    values = dict(NOMINAL)
    for name, value in data.items():
        if name not in known:
            meant = did_you_mean(name, known)
            raise FoldcarError(f'{file}: unknown parameter "{name}"{meant}; known: {", ".join(known)}')
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise FoldcarError(f"{file}: {name}: {value!r} is not a number")
        low, high = (float(known[name].value(score)) for score in (-MOST_SCORE, MOST_SCORE))
        low, high = min(low, known[name].nominal), max(high, known[name].nominal)
        if not low <= value <= high:
            raise FoldcarError(f"{file}: {name}: {value:g} is outside {low:.3g} to {high:.3g} {known[name].unit}")
        values[name] = float(value)
    return values


def as_calibration(file: Path, values: Mapping[str, float]) -> Calibration:
    """A calibration whose only draw is ``values``: sweeps take parameters in that form. It is not stored.

    Its name tells files of one name and other values apart.
    """
    unnamed = Calibration("", "", "", "", (values,), {}, REALITY_KIND)
    return replace(unnamed, name=f"{file.stem} {unnamed.fingerprint[:NAME_DIGITS]}")


def real_run(
    experiment: Experiment,
    nominal: Mapping[str, Any],
    scene: Mapping[str, Any],
    values: Mapping[str, float],
    sample: int,
    limits: NumberLimits,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Body and scene of sample ``sample`` with these values, for the body and the scene that the host believes in."""
    seed = experiment.variation_seed
    variation = calibrated_variation(values, experiment.variation, seed, sample)
    return vary_body(nominal, variation, limits), calibrated_scene(scene, values, seed, sample)
