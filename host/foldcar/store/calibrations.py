"""Calibrations in a store: posterior draws of the simulator's parameters, with a summary; and measured values.

Input: a store that is opened for reading or writing. Output: Calibrations, and measured values, which calibrations use as
known. The name of a calibration is unique, because runs are simulated with it.
"""

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foldcar.store.connection import StoreConnection, writing
from foldcar.store.errors import StoreError
from foldcar.store.info import CALIBRATION_KIND
from foldcar.store.reader import Store
from foldcar.store.rows import Row
from foldcar.store.tables import BUILD, CALIBRATION, EXPERIMENT, MEASURED
from foldcar.store.trial_writer import now_utc


@dataclass(frozen=True, slots=True)
class Calibration:
    """A calibration of the simulator by the trials of one experiment.

    ``draws`` are equally likely values of the parameters by name, in the order in which samples take them;
    ``summary`` is what docs/calibration.md describes, as JSON values. ``build`` is carsim's. ``kind`` is REALITY_KIND for
    parameters of a file, which are not inferred from trials and not stored.
    """

    name: str
    experiment: str
    build: str
    created_utc: str
    draws: tuple[Mapping[str, float], ...]
    summary: Mapping[str, Any]
    kind: str = CALIBRATION_KIND

    @property
    def fingerprint(self) -> str:
        """A hash of everything that simulations with it depend on."""
        return hashlib.sha256(json.dumps(self.draws, sort_keys=True).encode()).hexdigest()

    def draw_of(self, sample: int) -> Mapping[str, float]:
        """Return the values with which sample number ``sample`` of an environment is simulated."""
        return self.draws[sample % len(self.draws)]


def calibrations(store: Store) -> list[Calibration]:
    """Return all calibrations of a store in the order of their names. Raises StoreError."""
    builds = {row["id"]: row["name"] for row in store.rows(BUILD)}
    return [_read(store.path, row, builds) for row in store.rows(CALIBRATION, "ORDER BY name")]


def calibration_named(store: Store, name: str) -> Calibration:
    """Return the calibration of that name. Raises StoreError if it does not exist."""
    by_name = {calibration.name: calibration for calibration in calibrations(store)}
    if name not in by_name:
        remedy = f"it has {', '.join(by_name)}" if by_name else "make one with `foldcar calibrate`"
        raise StoreError(f'{store.path}: has no calibration "{name}"; {remedy}')
    return by_name[name]


def measured_values(store: Store, experiment: str) -> dict[str, float]:
    """Return the values measured for an experiment's trials of built cars, by parameter name."""
    return {row["parameter"]: row["value"] for row in store.rows(MEASURED, "WHERE experiment = ?", experiment)}


class CalibrationWriter(StoreConnection):
    """A store opened for calibrations. Create it with :func:`write_calibrations`; its methods raise StoreError."""

    def measure(self, experiment: str, values: Mapping[str, float | None]) -> None:
        """Store measured values by parameter name, replacing earlier ones; None deletes a value."""
        with self._transaction():
            for name, value in values.items():
                self._run("DELETE FROM measured WHERE experiment = ? AND parameter = ?", experiment, name)
                if value is not None:
                    self._insert(MEASURED, [{"experiment": experiment, "parameter": name, "value": value}])

    def put(self, calibration: Calibration, replace: bool) -> None:
        """Store a calibration. Raises StoreError if its name is taken, unless ``replace`` is set."""
        with self._transaction():
            row = {
                "name": calibration.name,
                "experiment": calibration.experiment,
                "build_id": self._identify("build", "name", calibration.build),
                "created_utc": calibration.created_utc,
                "draws": json.dumps(list(calibration.draws), allow_nan=False),
                "summary": json.dumps(calibration.summary, allow_nan=False),
            }
            if self.rows(CALIBRATION, "WHERE name = ?", calibration.name):
                if not replace:
                    raise _name_taken_error(self.path, calibration.name)
                # Another sweep may have begun while the calibration was computed.
                for experiment in self.rows(EXPERIMENT):
                    # What the experiment was swept under: a calibration, unless another kind is stored.
                    used = json.loads(experiment["facts"]).get("calibration") or {}
                    if (used.get("name"), used.get("kind", CALIBRATION_KIND)) == (calibration.name, CALIBRATION_KIND):
                        raise _in_use_error(self.path, calibration.name, experiment["id"])
            self._insert(CALIBRATION, [row], "OR REPLACE")


def check_calibration_name(store: Store, name: str, replace: bool) -> None:
    """Raise StoreError if a stored calibration has this name, unless ``replace`` is set and no sweep has used it."""
    if all(calibration.name != name for calibration in calibrations(store)):
        return
    if not replace:
        raise _name_taken_error(store.path, name)
    for info in store.info().experiments.values():
        if info.under == f"{CALIBRATION_KIND} {name}":
            raise _in_use_error(store.path, name, info.id)


def _in_use_error(store: Path, name: str, experiment: str) -> StoreError:
    return StoreError(
        f'{store}: calibration "{name}": experiment "{experiment}" was swept with it; choose another --name'
    )


def _name_taken_error(store: Path, name: str) -> StoreError:
    return StoreError(f'{store}: already has a calibration "{name}"; choose another --name, or use --replace')


@contextlib.contextmanager
def write_calibrations(path: Path) -> Iterator[CalibrationWriter]:
    """Open the store at ``path`` for calibrations. Raises StoreError if it is in use."""
    with writing(path) as connection:
        yield CalibrationWriter(path, connection)


def new_calibration(
    name: str, experiment: str, build: str, draws: list[dict[str, float]], summary: Mapping[str, Any]
) -> Calibration:
    """Return a calibration with the current time."""
    return Calibration(name, experiment, build, now_utc(), tuple(draws), summary)


def _read(path: Path, row: Row, builds: Mapping[int, str]) -> Calibration:
    """Read a calibration from its row. Raises StoreError if its build is missing."""
    if row["build_id"] not in builds:
        raise StoreError(f"{path}: build (id={row['build_id']}) is missing")
    return Calibration(
        row["name"],
        row["experiment"],
        builds[row["build_id"]],
        row["created_utc"],
        tuple(json.loads(row["draws"])),
        json.loads(row["summary"]),
    )
