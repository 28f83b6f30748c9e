"""The environment of an experiment under a calibration or a reality: sample k is simulated with its draw k mod n.

A reality is a file of what a simulated car and its ground differ in from what the host believes, for trials whose truth
is known: a JSON object of parameters, those that it leaves out keep the simulator's nominal values; some are of realities
only, so that a truth may lie outside what a calibration can find. An Environment for sweeps has scenes, variations and
fingerprints of its own, so that its runs stand beside the nominal ones and are never taken for them.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.inference.calibration import effects
from foldcar.inference.calibration.effects import REAL_ONLY, drawn_reality
from foldcar.inference.calibration.parameters import NAMES, NOMINAL, parameter_named
from foldcar.scenes.fingerprint import variation_code
from foldcar.simulation.engines import ENGINES, MUJOCO, MUJOCO_ENVIRONMENT
from foldcar.store.calibrations import Calibration
from foldcar.store.info import CALIBRATION_KIND, REALITY_KIND
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment, Study
from foldcar.study.listing_file import load_listing

# Beyond these scores the priors have no mass that matters, and the simulator's limits come near.
MAX_REAL_SCORE = 6.0
# Realities may leave it out.
WHEEL_SPREAD = "wheel_spread"
# Of the hash of the values, in a reality's name.
NAME_DIGITS = 8


class CalibratedEnvironment(Environment):
    """Built from the calibrated experiment of :func:`calibrated_study`. Raises FoldcarError without simulator."""

    def __init__(self, experiment: Experiment, calibration: Calibration, listed_id: str) -> None:
        super().__init__(experiment)
        beyond, optional = (set(), set()) if calibration.kind == CALIBRATION_KIND else (set(REAL_ONLY), {WHEEL_SPREAD})
        if not all(
            set(NAMES) - optional <= set(draw) <= set(NAMES) | beyond and all(map(math.isfinite, draw.values()))
            for draw in calibration.draws
        ):
            raise FoldcarError(
                f'calibration "{calibration.name}": its parameters are not those of this foldcar: calibrate again'
            )
        if super().dynamic:
            raise FoldcarError(
                f"{experiment.place}: {experiment.program_name} runs beside the simulation ({self.needs_scenic}), whose "
                f"scenes a {calibration.kind} cannot change; sweep this experiment without --{calibration.kind}"
            )
        self._calibration = calibration
        self._listed_id = listed_id
        self._seed = experiment.variation_seed
        self.listed_fingerprint = self.fingerprint
        effects_code = hashlib.sha256(Path(effects.__file__).read_bytes()).hexdigest()
        under = (calibration.fingerprint, self._seed, effects_code)
        self.fingerprint = _hashed(self.fingerprint, *under)
        self.spread_fingerprint = _hashed(dict(experiment.variation), *under, variation_code())

    @property
    def calibration(self) -> dict[str, str] | None:
        """As in ExperimentInfo."""
        one = self._calibration
        under = {"name": one.name, "fingerprint": one.fingerprint, "experiment": self._listed_id}
        return under if one.kind == CALIBRATION_KIND else {"kind": one.kind, **under}

    def variation(self, k: int) -> dict[str, Any]:
        """Return how car and ground of sample ``k`` differ from design and scene by the calibration's draw."""
        return drawn_reality(self._calibration.draw_of(k), self._experiment.variation, self._seed, k, k)

    def variation_identity(self) -> str:
        """A hash of the code that applies variations."""
        return variation_code()


def calibrated_id(experiment: str, calibration: Calibration) -> str:
    """The name, in stores, of an experiment under a calibration or a reality."""
    how = "calibrated" if calibration.kind == CALIBRATION_KIND else calibration.kind
    return f"{experiment} ({how} {calibration.name})"


def calibrated_study(study: Study, calibration: Calibration) -> Study:
    """The study with its experiments named for the calibration."""
    named = (replace(experiment, id=calibrated_id(experiment.id, calibration)) for experiment in study.experiments)
    return replace(study, experiments=tuple(named))


def calibrated_environment(experiment: Experiment, calibration: Calibration) -> CalibratedEnvironment:
    """The environment of an experiment of :func:`calibrated_study`."""
    listed_id = experiment.id.removesuffix(calibrated_id("", calibration))
    return CalibratedEnvironment(experiment, calibration, listed_id)


def _hashed(*parts: Any) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_reality(file: Path, engine: str) -> dict[str, float]:
    """Return the parameters of a reality for an engine by name. Raises FoldcarError.

    Parameters that ``file`` leaves out have their nominal values; differences between wheels stay those of the listing.
    """
    data, _ = load_listing(file)
    if not isinstance(data, Mapping):
        raise FoldcarError(f"{file}: is not a JSON object of parameters, as docs/calibration.md has them")
    values = {name: value for name, value in NOMINAL.items() if name != WHEEL_SPREAD}
    for name, value in data.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise FoldcarError(f"{file}: {name}: {value!r} is not a number")
        if name not in REAL_ONLY:
            parameter_named(name, value, f"{file}: {name}", MAX_REAL_SCORE, with_nominal=True, others=REAL_ONLY)
            values[name] = float(value)
            continue
        one = REAL_ONLY[name]
        if not one.least <= value <= one.largest:
            limits = f"{one.least:g} to {one.largest:g} ({one.unit})"
            raise FoldcarError(f"{file}: {name}: {value:g} is outside {limits}")
        if value != one.nominal:
            if one.mujoco_only and ENGINES[engine].environment != MUJOCO_ENVIRONMENT:
                raise FoldcarError(f"{file}: {name}: {engine} has no such tyres; --engine {MUJOCO} has them")
            values[name] = float(value)
    return values


def as_calibration(file: Path, values: Mapping[str, float]) -> Calibration:
    """A calibration whose only draw is ``values``: sweeps take parameters in that form. It is not stored.

    Its name tells files of one name and other values apart.
    """
    unnamed = Calibration("", "", "", "", (values,), {}, REALITY_KIND)
    return replace(unnamed, name=f"{file.stem} {unnamed.fingerprint[:NAME_DIGITS]}")
