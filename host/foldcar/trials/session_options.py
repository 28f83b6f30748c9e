"""What a session of trials, the command `foldcar log`, works with: its options, its car, and its trials."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from foldcar.car.design import Design
from foldcar.link.car import CarIdentity
from foldcar.store.trial_records import Ending
from foldcar.trials.drive_end import DriveEnd


@dataclass(frozen=True)
class SessionOptions:
    """The options of `foldcar log`; those that are None are asked for or chosen in the session, unless ``yes``."""

    listing: Path
    experiment: str
    store: Path
    settings: Mapping[str, float | str]
    sample: int | None
    trials: int | None
    deviations: list[str] | None
    outcome: str | None
    note: str | None
    operator: str
    countdown_s: int
    untethered: bool
    button: bool
    any_build: bool
    yes: bool
    car: str | None = None
    media_folder: Path | None = None  # a phone puts photos and films of each trial here


@dataclass(frozen=True)
class CheckedCar:
    """A car that has been checked and may drive the trials."""

    identity: CarIdentity
    design: Design


@dataclass(frozen=True)
class DrivenTrial:
    """A driven trial of the session, with its end as it was stored."""

    number: int
    sample: int
    log: Path
    stored: Ending
    end: DriveEnd
