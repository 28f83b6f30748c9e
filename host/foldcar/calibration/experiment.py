"""A swept experiment of a store as the simulator takes it: bodies, settings and scenes, without listing and program.

Input: a store and the name of an experiment. Output: a SweptExperiment. FoldcarError if its runs cannot be repeated with
changed parameters.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store
from foldcar.store.rows import parsed
from foldcar.store.tables import BY_NAME, DESIGN, ENVIRONMENT, EXPERIMENT

# Fewer scenes are no sample of an environment.
LEAST_SCENES = 20


@dataclass(frozen=True, slots=True)
class SweptDesign:
    """A design by its parameters (``width_mm``, …), with its body and settings as in docs/carsim.md."""

    parameters: Mapping[str, float]
    body: Mapping[str, Any]
    settings: str


@dataclass(frozen=True)
class SweptExperiment:
    """``designs`` and ``scenes`` in the store's order; ``info`` as the store has it."""

    info: ExperimentInfo
    designs: tuple[SweptDesign, ...]
    scenes: tuple[Mapping[str, Any], ...]

    def design_of(self, parameters: Mapping[str, float]) -> int | None:
        """The index of the design with these parameters; None if it has none such."""
        return self._indices.get(frozenset(parameters.items()))

    @cached_property
    def _indices(self) -> dict[frozenset[tuple[str, float]], int]:
        return {frozenset(design.parameters.items()): i for i, design in enumerate(self.designs)}


def read_experiment(store: Store, name: str) -> SweptExperiment:
    """The experiment ``name`` of ``store``. FoldcarError."""
    place = f"{store.path}: experiment {name}"
    known = store.info().experiments
    if name not in known:
        swept = ", ".join(known)
        raise FoldcarError(f"{place}: was not swept into this store, which has {swept}: sweep its listing first")
    info = known[name]
    if info.calibration is not None:
        listed = info.calibration["experiment"]
        raise FoldcarError(f"{place}: was swept under {info.under}: calibrate by experiment {listed} instead")
    if not info.success_defined:
        raise FoldcarError(f"{place}: {info.success_rule}")
    (row,) = store.rows(EXPERIMENT, "WHERE id = ?", name)
    (environment,) = store.rows(ENVIRONMENT, "WHERE id = ?", row["environment_id"])
    if environment["dynamic"]:
        raise FoldcarError(
            f"{place}: {info.scenic_program} runs beside the simulation, whose scenes cannot be changed; calibrate in an "
            "environment whose program only places things"
        )
    scenes = [
        _json(store, "scene", one["scene_id"])
        for one in store.rows(BY_NAME["sample"], "WHERE environment_id = ? ORDER BY sample", environment["id"])
    ]
    if len(scenes) < LEAST_SCENES:
        raise FoldcarError(
            f"{place}: the store has {len(scenes)} scenes of its environment, a calibration needs {LEAST_SCENES}: "
            f"sweep with --environments {LEAST_SCENES} or more"
        )
    designs = [
        SweptDesign(
            parsed(store.path, DESIGN, one, "parameters"),
            _json(store, "body", one["body_id"]),
            json.dumps(_json(store, "settings", one["settings_id"])),
        )
        for one in store.rows(DESIGN, "WHERE experiment = ? ORDER BY position", name)
    ]
    return SweptExperiment(info, tuple(designs), tuple(scenes))


def _json(store: Store, table: str, number: int) -> dict[str, Any]:
    for row in store.rows(BY_NAME[table], "WHERE id = ?", number):
        found: dict[str, Any] = parsed(store.path, BY_NAME[table], row, "json")
        return found
    raise FoldcarError(f"{store.path}: {table} (id={number}) is missing; `foldcar check` names all that is")
