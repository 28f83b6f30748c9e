"""What `foldcar log` was told on its command line."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class LogOptions:
    """What the command line says; None is asked for, or found out."""

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
