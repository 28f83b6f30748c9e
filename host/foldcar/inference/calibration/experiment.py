"""Reads a swept experiment's designs and scenes from a store.

Input: a store and the name of an experiment; neither listing nor Scenic program is needed. Output: a SweptExperiment.
Raises FoldcarError.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.study.reality_runs import MIN_SCENES

PASSED = "passed"


@dataclass(frozen=True, slots=True)
class SweptDesign:
    """A design by its parameters (``width_mm``, …), with its body and settings as in docs/carsim.md."""

    parameters: Mapping[str, float]
    body: Mapping[str, Any]
    settings: str


@dataclass(frozen=True)
class SweptExperiment:
    """A swept experiment: its stored description, its ``designs`` and ``scenes`` in the store's order."""

    info: ExperimentInfo
    designs: tuple[SweptDesign, ...]
    scenes: tuple[Mapping[str, Any], ...]

    def design_of(self, parameters: Mapping[str, float]) -> int | None:
        """Return the index of the design with these parameters; None if there is no such design."""
        return self._indices.get(frozenset(parameters.items()))

    def varied(self, design: int) -> dict[str, float]:
        """Return the parameters that vary over the family, for the design with this index."""
        return {name: float(self.designs[design].parameters[name]) for name in self.info.varied}

    @cached_property
    def _indices(self) -> dict[frozenset[tuple[str, float]], int]:
        """The designs' indices by their parameters."""
        return {frozenset(design.parameters.items()): i for i, design in enumerate(self.designs)}


def read_experiment(store: Store, name: str) -> SweptExperiment:
    """Read the designs and scenes of experiment ``name``. Raises FoldcarError if there can be no belief about it."""
    place = f"{store.path}: experiment {name}"
    experiments = store.info().experiments
    if name not in experiments:
        swept = ", ".join(experiments)
        raise FoldcarError(f"{place}: was not swept into this store, which has {swept}: sweep its listing first")
    info = experiments[name]
    if info.reality is not None:
        raise FoldcarError(f"{place}: was swept in a {info.under}: take experiment {info.listed_id} instead")
    if not info.success_defined:
        raise FoldcarError(f"{place}: {info.success_rule}")
    drives = read_drives(store, name)
    if drives.dynamic:
        raise FoldcarError(
            f"{place}: {info.scenic_program} runs beside the simulation, whose scenes cannot be changed; take an "
            "environment whose program only places things"
        )
    scenes = [drives.value("scene", scene) for scene in drives.scenes.values()]
    if len(scenes) < MIN_SCENES:
        raise FoldcarError(
            f"{place}: the store has {len(scenes)} scenes of its environment, {MIN_SCENES} are needed: "
            f"sweep with --samples {MIN_SCENES} or more"
        )
    designs = [
        SweptDesign(parameters, drives.value("body", body), drives.text("settings", settings))
        for parameters, body, settings in zip(drives.parameters, drives.bodies, drives.settings, strict=True)
    ]
    return SweptExperiment(info, tuple(designs), tuple(scenes))
