"""The record of a trial, which the store contains beside the simulated runs.

A person judges a trial, so its outcomes differ from those of a run (:mod:`foldcar.simulation.results`).
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from foldcar.errors import FoldcarError

# In the order of tables. ``not_passed`` is for imported trials without a more precise outcome; ``aborted`` trials do
# not count in success rates.
TRIAL_OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "not_passed", "aborted")

# What drove. Where a store does not say it, it is shown as UNKNOWN. Only trials of built cars count in success rates.
BUILT, SIMULATED = CARS = ("built", "simulated")
UNKNOWN = "unknown"
WITHDRAWN = "withdrawn"

# Why trials of other standings than a built car's are left out.
_REASONS = {
    SIMULATED: "of a simulated car (--simulated-trials shows them)",
    UNKNOWN: "of a car that may be built or simulated (tell with `foldcar trials correct` and --car)",
    WITHDRAWN: "withdrawn (`foldcar trials list` shows why)",
}

# Photos and films by the endings of their files' names.
PHOTO, FILM = "photo", "film"
MEDIA_ENDINGS = {PHOTO: (".jpg", ".jpeg", ".png", ".heic"), FILM: (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm")}

# The largest whole number that SQLite keeps.
MAX_ID = 2**63 - 1

# A trial of a day is a slip of the pen (s).
LONGEST_S = 86_400.0

# The ending of a row from before the start until the trial is completed.
RUNNING = "running"
# Its ending if the program was killed meanwhile.
INTERRUPTED = "the program was ended"


def checked_name(name: str, place: str) -> str:
    """A car's name without space around it; FoldcarError at ``place`` if there is none, or it is no short line."""
    kept = name.strip()
    if not kept.isprintable() or not 0 < len(kept) <= LONGEST_NAME:
        raise FoldcarError(f"{place}: {name[:80]!r} is no name of 1 to {LONGEST_NAME} printable characters")
    return kept


def not_entered(ending: str) -> str:
    """The ending of a drive whose outcome the person has still to tell."""
    return f"{ending}; outcome not entered"


# The fields that `foldcar trials correct` may change.
CORRECTABLE = ("outcome", "elapsed_time_s", "note", "operator", "car", "car_name")

# A car's name is a word or a few, for tables.
LONGEST_NAME = 40


@dataclass(frozen=True, slots=True)
class TrialDesign:
    """The car of a trial: its type string, and its parameters by their column names in results (``width_mm``)."""

    vehicle_type: str
    columns: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Ending:
    """The end of a trial: ``ending`` is its cause (goal, time limit, key, …), ``outcome`` one of TRIAL_OUTCOMES.

    ``elapsed_time_s`` is the drive's time by the car's own clock, None if unknown; ``log_sha256`` is the hash of
    the log's bytes, None if there is no log.
    """

    outcome: str
    ending: str
    elapsed_time_s: float | None
    note: str
    log_sha256: str | None


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial; ``uuid`` identifies it in every store.

    ``deviations`` are those of car and obstacles from their planned places (:mod:`placement`).
    ``deviations`` maps "car" and obstacles' letters to (x in m, y in m, heading in rad). None stands for what is
    not known: ``sample``, times, builds and log of trials that come from elsewhere, whose ``source`` says where.
    ``car`` is one of CARS, None if that is not known; ``car_name`` tells cars of one design apart, and trials without it
    are of one car. ``corrections`` counts what was changed afterwards.
    """

    id: int
    uuid: str
    experiment: str
    vehicle_type: str
    design: Mapping[str, float]
    sample: int | None
    deviations: Mapping[str, tuple[float, float, float]]
    outcome: str
    ending: str
    elapsed_time_s: float | None
    note: str
    operator: str
    started_utc: str | None
    ended_utc: str | None
    firmware_build: str | None
    design_hash: str | None
    log: str | None
    log_sha256: str | None
    source: str | None
    car: str | None
    car_name: str | None
    withdrawn: bool
    scenic_program: str | None
    corrections: int

    @property
    def standing(self) -> str:
        """What it is good for: one of CARS, UNKNOWN or, whatever drove, WITHDRAWN."""
        return WITHDRAWN if self.withdrawn else self.car or UNKNOWN

    @property
    def completed(self) -> bool:
        """Whether it was completed and not aborted. Others count in no success rate."""
        return self.outcome != "aborted"

    @property
    def counts(self) -> bool:
        """Whether it counts in success rates: of a built car, completed, not withdrawn."""
        return self.standing == BUILT and self.completed


@dataclass(frozen=True, slots=True)
class Track:
    """Where a camera saw the car in a trial: the columns of the store's table of that name.

    Rows begin with time in the trial (s), x, y, z (m), heading, pitch, roll (rad).
    """

    trial: int
    film: str
    film_sha256: str
    start_s: float
    outcome: str | None
    facts: Mapping[str, Any]
    rows: Sequence[Sequence[float]]


@dataclass(frozen=True, slots=True)
class Media:
    """A photo or film of a trial: ``kind`` is a key of MEDIA_ENDINGS, ``file`` a :func:`log_files.reference`."""

    trial: int
    kind: str
    file: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Correction:
    """One changed field of a trial, with its value before (None for none) and after."""

    trial: int
    corrected_utc: str
    field: str
    before: str | float | None
    after: str | float | None
    reason: str
    operator: str


def select_trials(trials: Iterable[Trial], with_simulated: bool) -> tuple[list[Trial], Counter[str]]:
    """The trials of built cars, ``with_simulated`` also those of simulated ones; the numbers of others by standing."""
    kept, left_out = [], Counter[str]()
    for trial in trials:
        if trial.standing == BUILT or (with_simulated and trial.standing == SIMULATED):
            kept.append(trial)
        else:
            left_out[trial.standing] += 1
    return kept, left_out


def left_out_text(left_out: Counter[str]) -> str | None:
    """A sentence that says what is left out and why; None if nothing is."""
    parts = [f"{left_out[standing]} {why}" for standing, why in _REASONS.items() if left_out[standing]]
    return f"Trials left out: {'; '.join(parts)}." if parts else None
