"""The options of `foldcar log`."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class LogOptions:
    """The command line's values; what is None is asked for or determined during the session."""

    store: Path
    settings: list[str]
    sample: int | None
    trials: int | None
    parameters: Path | None
    deviations: list[str] | None
    outcome: str | None
    note: str | None
    operator: str
    countdown_s: int
    untethered: bool
    any_build: bool
    yes: bool
