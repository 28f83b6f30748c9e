"""The options of a session of trials, which is the command `foldcar log`."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


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
