"""Calibrations in a store: draws of the simulator's parameters from their posterior, and what was told with them.

Input: a store, read or opened to be written. Output: Calibrations; values that were measured, which calibrations take as
known. A name is given once: runs are simulated under it.
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
    ``summary`` is what docs/calibration.md describes, as JSON values. ``build`` is carsim's. ``kind`` is REALITY for
    parameters of a file, which no trials stand behind and no store keeps.
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
        """A hash of what simulations under it depend on."""
        return hashlib.sha256(json.dumps(self.draws, sort_keys=True).encode()).hexdigest()

    def draw_of(self, sample: int) -> Mapping[str, float]:
        """The values that sample ``sample`` of an environment is simulated with."""
        return self.draws[sample % len(self.draws)]


def calibrations(store: Store) -> list[Calibration]:
    """All calibrations of a store by name. StoreError."""
    builds = {row["id"]: row["name"] for row in store.rows(BUILD)}
    return [_read(store.path, row, builds) for row in store.rows(CALIBRATION, "ORDER BY name")]


def calibration_named(store: Store, name: str) -> Calibration:
    """The calibration of that name; StoreError if there is none."""
    known = {calibration.name: calibration for calibration in calibrations(store)}
    if name not in known:
        has = f"it has {', '.join(known)}" if known else "make one with `foldcar calibrate`"
        raise StoreError(f'{store.path}: has no calibration "{name}"; {has}')
    return known[name]


def measured_values(store: Store, experiment: str) -> dict[str, float]:
    """The values that were measured for an experiment's trials of built cars, by the parameter's name."""
    return {row["parameter"]: row["value"] for row in store.rows(MEASURED, "WHERE experiment = ?", experiment)}


class CalibrationWriter(StoreConnection):
    """A store opened for calibrations. Made by :func:`write_calibrations`; its methods raise StoreError."""

    def measure(self, experiment: str, values: Mapping[str, float | None]) -> None:
        """Store measured values by the parameter's name in place of earlier ones; None deletes a value."""
        with self._transaction():
            for name, value in values.items():
                self._run("DELETE FROM measured WHERE experiment = ? AND parameter = ?", experiment, name)
                if value is not None:
                    self._insert(MEASURED, [{"experiment": experiment, "parameter": name, "value": value}])

    def put(self, calibration: Calibration, replace: bool) -> None:
        """Store it; StoreError if its name is taken, unless it is to ``replace`` what has it."""
        with self._transaction():
            row = {
                "name": calibration.name,
                "experiment": calibration.experiment,
                "build_id": self._identify("build", "name", calibration.build),
                "created_utc": calibration.created_utc,
                "draws": json.dumps(list(calibration.draws), allow_nan=False),
                "summary": json.dumps(calibration.summary, allow_nan=False),
            }
            if self._rows(CALIBRATION, "WHERE name = ?", calibration.name):
                if not replace:
                    raise _taken(self.path, calibration.name)
                # Another sweep may have begun while the calibration was computed.
                for experiment in self._rows(EXPERIMENT):
                    under = json.loads(experiment["facts"]).get("calibration") or {}
                    if (under.get("name"), under.get("kind", CALIBRATION_KIND)) == (calibration.name, CALIBRATION_KIND):
                        raise _swept_under(self.path, calibration.name, experiment["id"])
            self._insert(CALIBRATION, [row], "OR REPLACE")


def check_calibration_name(store: Store, name: str, replace: bool) -> None:
    """StoreError if there is a calibration of that name that is not to be replaced, or that was swept under."""
    if all(calibration.name != name for calibration in calibrations(store)):
        return
    if not replace:
        raise _taken(store.path, name)
    for info in store.info().experiments.values():
        if info.under == f"{CALIBRATION_KIND} {name}":
            raise _swept_under(store.path, name, info.id)


def _swept_under(store: Path, name: str, experiment: str) -> StoreError:
    return StoreError(
        f'{store}: calibration "{name}": experiment "{experiment}" was swept under it: choose another --name'
    )


def _taken(store: Path, name: str) -> StoreError:
    return StoreError(f'{store}: has a calibration "{name}" already: choose another --name, or --replace it')


@contextlib.contextmanager
def write_calibrations(path: Path) -> Iterator[CalibrationWriter]:
    """The store at ``path`` for calibrations. StoreError if it is in use."""
    with writing(path) as connection:
        yield CalibrationWriter(path, connection)


def new_calibration(
    name: str, experiment: str, build: str, draws: list[dict[str, float]], summary: Mapping[str, Any]
) -> Calibration:
    """A calibration that is made now."""
    return Calibration(name, experiment, build, now_utc(), tuple(draws), summary)


def _read(path: Path, row: Row, builds: Mapping[int, str]) -> Calibration:
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
