"""The environment of an experiment in a reality: all samples are simulated with the same parameters of car and ground.

A reality is a file of true parameter values that the host does not know: it makes simulated trials with a known truth. It
is a JSON object of parameters. Those that it leaves out keep the simulator's nominal values. Some parameters belong to
such files only, so that a truth may lie outside what trials can teach. A RealityEnvironment has fingerprints of its own,
so that stores keep its runs apart from the nominal ones.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from foldcar.belief import reality as effects
from foldcar.belief.priors import NOMINAL, parameter_named
from foldcar.belief.reality import REAL_ONLY, RealParameter, drawn_reality
from foldcar.errors import FoldcarError
from foldcar.scenes.fingerprint import variation_code
from foldcar.shown_text import shown_line
from foldcar.simulation.engines import ENGINES, MUJOCO, MUJOCO_ENVIRONMENT
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment, ListedStudy
from foldcar.study.listing_file import load_listing

# Largest score of a parameter of a reality: beyond it a prior has a mass of 1e-9, and the simulator's limits are near.
MAX_REAL_SCORE = 6.0
# The only parameter that a reality may lack; the listing's spreads of wheels then apply.
WHEEL_SPREAD = "wheel_spread"
# Number of hexadecimal digits of the values' hash in a reality's name.
NAME_DIGITS = 8


@dataclass(frozen=True, slots=True)
class Reality:
    """The parameters of a reality by name, from a file whose name is ``stem``."""

    stem: str
    values: Mapping[str, float]

    @property
    def fingerprint(self) -> str:
        """A hash of everything that simulations in it depend on."""
        return hashed(dict(self.values))

    @property
    def name(self) -> str:
        """Its name in stores, which ends with a hash, because files of the same name may have other values."""
        return f"{self.stem} {self.fingerprint[:NAME_DIGITS]}"


class ChangedEnvironment(ExperimentEnvironment):
    """An environment in which car and ground differ from design and scene by the simulator's parameters."""

    def __init__(self, experiment: Experiment, end_of_message: str) -> None:
        """Create the environment. Raises FoldcarError if Scenic must run the program during the simulation.

        The scenes of such a program cannot be changed. The error's message has the form "PLACE: PROGRAM runs beside the
        simulation, whose scenes END", where ``end_of_message`` is the end.
        """
        super().__init__(experiment)
        if self.dynamic:
            raise FoldcarError(
                f"{experiment.place}: {experiment.program_name} runs beside the simulation ({self.needs_scenic}), whose "
                f"scenes {end_of_message}"
            )
        self._seed = experiment.variation_seed

    def values(self, k: int) -> Mapping[str, float]:
        """Return the simulator's parameters in sample ``k`` by name."""
        raise NotImplementedError

    def variation(self, k: int) -> dict[str, Any]:
        """Return how car and ground of sample ``k`` differ from design and scene."""
        return drawn_reality(self.values(k), self._experiment.variation, self._seed, k, k)

    def variation_identity(self) -> str:
        """Return a hash of the code that applies variations."""
        return variation_code()


class RealityEnvironment(ChangedEnvironment):
    """Built from an experiment of :func:`study_in_reality`. Raises FoldcarError if its program needs Scenic in runs."""

    def __init__(self, experiment: Experiment, reality: Reality) -> None:
        super().__init__(experiment, "a reality cannot change; sweep this experiment without --reality")
        self._reality = reality
        self.nominal_fingerprint = self.fingerprint
        identity = (reality.fingerprint, self._seed, reality_code())
        self.fingerprint = hashed(self.fingerprint, *identity)
        self.spread_fingerprint = hashed(dict(experiment.variation), *identity, variation_code())

    @property
    def reality(self) -> dict[str, str]:
        """Name and fingerprint of the reality, and the listed experiment, as in ExperimentInfo."""
        listed_id = self._experiment.id.removesuffix(_suffix(self._reality))
        return {"name": self._reality.name, "fingerprint": self._reality.fingerprint, "experiment": listed_id}

    def values(self, k: int) -> Mapping[str, float]:
        """Return the reality's parameters, the same in all samples."""
        return self._reality.values


def study_in_reality(study: ListedStudy, reality: Reality) -> ListedStudy:
    """Return the study with the reality's name added to the names of its experiments: "width (reality lab 3f9c01ab)"."""
    renamed = (replace(experiment, id=experiment.id + _suffix(reality)) for experiment in study.experiments)
    return replace(study, experiments=tuple(renamed))


def _suffix(reality: Reality) -> str:
    """Return what is added to the name of an experiment in a reality."""
    return f" (reality {reality.name})"


def reality_code() -> str:
    """Return a hash of the code that makes realities of parameters."""
    return hashlib.sha256(Path(effects.__file__).read_bytes()).hexdigest()


def hashed(*parts: Any) -> str:
    """Return the SHA-256 hash of values that JSON can hold."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def read_reality(file: Path, engine: str) -> Reality:
    """Read a reality from a JSON file, and check that the engine can simulate it. Raises FoldcarError.

    A parameter that the file leaves out has its nominal value. The wheel spread, which says how much the wheels of a car
    differ, has none: if the file leaves it out, the differences that the listing gives apply.
    """
    data, _ = load_listing(file)
    if not isinstance(data, Mapping):
        raise FoldcarError(f"{file}: is not a JSON object of parameters; docs/realities.md lists them")
    values = {name: value for name, value in NOMINAL.items() if name != WHEEL_SPREAD}
    for name, value in data.items():
        place = f"{file}: {name}"
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise FoldcarError(f"{place}: {value!r} is not a number")
        if name in REAL_ONLY:
            parameter = REAL_ONLY[name]
            _check_real_only(parameter, value, place, engine)
            # The nominal value means the same as if the file left the parameter out.
            if value != parameter.nominal:
                values[name] = float(value)
        else:
            # This raises FoldcarError if no parameter has the name, or if the value is outside the parameter's limits.
            parameter_named(name, value, place, MAX_REAL_SCORE, with_nominal=True, others=REAL_ONLY)
            values[name] = float(value)
    return Reality(shown_line(file.stem), values)


def _check_real_only(parameter: RealParameter, value: float, place: str, engine: str) -> None:
    """Raise FoldcarError, which begins with ``place``, if the engine cannot simulate this value of a parameter."""
    if not parameter.least <= value <= parameter.largest:
        limits = f"{parameter.least:g} to {parameter.largest:g} ({parameter.unit})"
        raise FoldcarError(f"{place}: {value:g} is outside {limits}")
    is_mujoco = ENGINES[engine].environment == MUJOCO_ENVIRONMENT
    if value != parameter.nominal and parameter.mujoco_only and not is_mujoco:
        raise FoldcarError(f"{place}: {engine} has no such tyres; --engine {MUJOCO} has them")
