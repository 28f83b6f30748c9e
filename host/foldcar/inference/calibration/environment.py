"""The environment of an experiment under a calibration or a reality: sample k is simulated with draw k mod n.

A reality is a file of true parameter values that the host does not know: it makes simulated trials with a known truth. It
is a JSON object of parameters. Those that it leaves out keep the simulator's nominal values. Some parameters belong to
realities only, so that a truth may lie outside what a calibration can infer. A CalibratedEnvironment has fingerprints of
its own, so that stores keep its runs apart from the nominal ones.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from foldcar.belief import reality as effects
from foldcar.belief.priors import NAMES, NOMINAL, parameter_named
from foldcar.belief.reality import REAL_ONLY, drawn_reality
from foldcar.errors import FoldcarError
from foldcar.scenes.fingerprint import variation_code
from foldcar.simulation.engines import ENGINES, MUJOCO, MUJOCO_ENVIRONMENT
from foldcar.store.calibrations import Calibration
from foldcar.store.info import CALIBRATION_KIND, REALITY_KIND
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment, Study
from foldcar.study.listing_file import load_listing

# Largest score of a parameter of a reality: beyond it a prior has a mass of 1e-9, and the simulator's limits are near.
MAX_REAL_SCORE = 6.0
# The only parameter that a reality may lack; the listing's spreads of wheels then apply.
WHEEL_SPREAD = "wheel_spread"
# Number of hexadecimal digits of the values' hash in a reality's name.
NAME_DIGITS = 8


class CalibratedEnvironment(Environment):
    """Built from the calibrated experiment of :func:`calibrated_study`. Raises FoldcarError without simulator."""

    def __init__(self, experiment: Experiment, calibration: Calibration, listed_id: str) -> None:
        super().__init__(experiment)
        required, allowed = set(NAMES), set(NAMES)
        if calibration.kind != CALIBRATION_KIND:
            # A reality may lack the spread of wheels, and may have parameters that no calibration infers.
            required, allowed = required - {WHEEL_SPREAD}, allowed | set(REAL_ONLY)
        if not all(
            required <= set(draw) <= allowed and all(map(math.isfinite, draw.values())) for draw in calibration.draws
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
        draws_identity = (calibration.fingerprint, self._seed, effects_code)
        self.fingerprint = _hashed(self.fingerprint, *draws_identity)
        self.spread_fingerprint = _hashed(dict(experiment.variation), *draws_identity, variation_code())

    @property
    def calibration(self) -> dict[str, str] | None:
        """Name, fingerprint and listed experiment of the calibration, and the kind of a reality, as in ExperimentInfo."""
        kind, name, fingerprint = self._calibration.kind, self._calibration.name, self._calibration.fingerprint
        identity = {"name": name, "fingerprint": fingerprint, "experiment": self._listed_id}
        return identity if kind == CALIBRATION_KIND else {"kind": kind, **identity}

    def variation(self, k: int) -> dict[str, Any]:
        """Return how car and ground of sample ``k`` differ from design and scene by the calibration's draw."""
        return drawn_reality(self._calibration.draw_of(k), self._experiment.variation, self._seed, k, k)

    def variation_identity(self) -> str:
        """Return a hash of the code that applies variations."""
        return variation_code()


def calibrated_id(experiment: str, calibration: Calibration) -> str:
    """Return the name, in stores, of an experiment under a calibration or a reality: "width (calibrated lab)"."""
    label = "calibrated" if calibration.kind == CALIBRATION_KIND else calibration.kind
    return f"{experiment} ({label} {calibration.name})"


def calibrated_study(study: Study, calibration: Calibration) -> Study:
    """Return the study with the calibration's name added to the names of its experiments."""
    renamed = (replace(experiment, id=calibrated_id(experiment.id, calibration)) for experiment in study.experiments)
    return replace(study, experiments=tuple(renamed))


def calibrated_environment(experiment: Experiment, calibration: Calibration) -> CalibratedEnvironment:
    """Return the environment of an experiment of :func:`calibrated_study`."""
    listed_id = experiment.id.removesuffix(calibrated_id("", calibration))
    return CalibratedEnvironment(experiment, calibration, listed_id)


def _hashed(*parts: Any) -> str:
    """Return the SHA-256 hash of values that JSON can hold."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_reality(file: Path, engine: str) -> dict[str, float]:
    """Read the parameters of a reality from a JSON file, by name, and check that the engine simulates them.

    Parameters that ``file`` leaves out have their nominal values, except WHEEL_SPREAD, which is then missing. Raises
    FoldcarError.
    """
    data, _ = load_listing(file)
    if not isinstance(data, Mapping):
        raise FoldcarError(f"{file}: is not a JSON object of parameters; docs/calibration.md lists them")
    values = {name: value for name, value in NOMINAL.items() if name != WHEEL_SPREAD}
    for name, value in data.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise FoldcarError(f"{file}: {name}: {value!r} is not a number")
        if name not in REAL_ONLY:
            parameter_named(name, value, f"{file}: {name}", MAX_REAL_SCORE, with_nominal=True, others=REAL_ONLY)
            values[name] = float(value)
            continue
        parameter = REAL_ONLY[name]
        if not parameter.least <= value <= parameter.largest:
            limits = f"{parameter.least:g} to {parameter.largest:g} ({parameter.unit})"
            raise FoldcarError(f"{file}: {name}: {value:g} is outside {limits}")
        if value != parameter.nominal:
            if parameter.mujoco_only and ENGINES[engine].environment != MUJOCO_ENVIRONMENT:
                raise FoldcarError(f"{file}: {name}: {engine} has no such tyres; --engine {MUJOCO} has them")
            values[name] = float(value)
    return values


def as_calibration(file: Path, values: Mapping[str, float]) -> Calibration:
    """Return a calibration whose only draw is ``values``, the form in which sweeps take parameters. It is not stored.

    Its name ends with a hash of the values, because files of the same name may have other values.
    """
    unnamed = Calibration("", "", "", "", (values,), {}, REALITY_KIND)
    return replace(unnamed, name=f"{file.stem} {unnamed.fingerprint[:NAME_DIGITS]}")
