"""The record of a trial, which the store keeps beside the simulated runs.

A person judges a trial, so its outcomes differ from those of a run (:mod:`foldcar.simulation.results`).
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from foldcar.errors import FoldcarError

# Outcomes in the order in which tables show them. ``not_passed`` is for imported trials without a more precise outcome;
# ``aborted`` trials do not count in success rates.
TRIAL_OUTCOMES = ("passed", "tipped", "stuck", "off_course", "timeout", "not_passed", "aborted")

# Whether a built or a simulated car drove; UNKNOWN if the store does not say which. Only trials of built cars count in
# success rates.
BUILT, SIMULATED = CARS = ("built", "simulated")
UNKNOWN = "unknown"
WITHDRAWN = "withdrawn"

# Why trials are left out of success rates, by their standing.
_REASONS = {
    SIMULATED: "of a simulated car (--simulated-trials counts them)",
    UNKNOWN: "of a car that may be built or simulated (`foldcar trials correct --car` says which)",
    WITHDRAWN: "withdrawn (`foldcar trials list` shows why)",
}

# Suffixes of photos and films.
PHOTO, FILM = "photo", "film"
MEDIA_ENDINGS = {PHOTO: (".jpg", ".jpeg", ".png", ".heic"), FILM: (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm")}

# SQLite's largest integer.
MAX_ID = 2**63 - 1

# Longest trial (s); a longer time is a typing error.
LONGEST_S = 86_400.0

# The ending of a trial that has begun and is not completed yet.
RUNNING = "running"
# The ending of a trial during which foldcar was killed.
INTERRUPTED = "the program was ended"


class TrialDrive(NamedTuple):
    """The inputs of a trial as JSON texts: the car's body, the settings, and the scene as it was really placed."""

    body: str
    settings: str
    scene: str


def checked_name(name: str, place: str) -> str:
    """Return a car's name without outer spaces.

    Raises FoldcarError, which starts with ``place``, if it is empty, too long or not printable.
    """
    stripped = name.strip()
    if not stripped.isprintable() or not 0 < len(stripped) <= MAX_NAME_LENGTH:
        raise FoldcarError(f"{place}: {name[:80]!r} is not a name of 1 to {MAX_NAME_LENGTH} printable characters")
    return stripped


def ending_without_outcome(ending: str) -> str:
    """Return the ending to store for a drive whose outcome the operator has not entered yet."""
    return f"{ending}; outcome not entered"


# The fields that `foldcar trials correct` may change.
CORRECTABLE = ("outcome", "elapsed_time_s", "note", "operator", "car", "car_name")

# Maximum length of a car's name, which is shown in tables.
MAX_NAME_LENGTH = 40


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
    """One trial: ``id`` is its number in this store, ``uuid`` identifies it in every store.

    ``deviations`` maps "car" and the letters of obstacles to how far they stood from their planned positions (x in m,
    y in m, heading in rad). An imported trial has a ``source``; its ``sample``, times, builds and log may be unknown, and
    are then None. ``car`` is one of CARS, None if unknown. ``car_name`` distinguishes built cars of one design; trials of
    a design without a name are all of the same car. ``corrections`` is how many corrections the trial has.
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
        """Whether it is withdrawn (WITHDRAWN), and otherwise which car drove: one of CARS, or UNKNOWN."""
        if self.withdrawn:
            return WITHDRAWN
        return self.car or UNKNOWN

    @property
    def completed(self) -> bool:
        """Whether it was not aborted; aborted trials count in no success rate."""
        return self.outcome != "aborted"

    @property
    def counts(self) -> bool:
        """Whether it counts in success rates: of a built car, completed, not withdrawn."""
        return self.standing == BUILT and self.completed


@dataclass(frozen=True, slots=True)
class Media:
    """A photo or film of a trial: ``kind`` is a key of MEDIA_ENDINGS, ``file`` a :func:`log_files.reference`."""

    trial: int
    kind: str
    file: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Correction:
    """One changed field of a trial, with its value before and after; None stands for an empty field."""

    trial: int
    corrected_utc: str
    field: str
    before: str | float | None
    after: str | float | None
    reason: str
    operator: str


def select_trials(trials: Iterable[Trial], with_simulated: bool) -> tuple[list[Trial], Counter[str]]:
    """Select the trials of built cars and, if ``with_simulated``, those of simulated cars.

    Returns these trials, and how many others there are by standing: simulated, unknown or withdrawn.
    """
    selected = []
    left_out: Counter[str] = Counter()
    for trial in trials:
        if trial.standing == BUILT or (with_simulated and trial.standing == SIMULATED):
            selected.append(trial)
        else:
            left_out[trial.standing] += 1
    return selected, left_out


def left_out_text(left_out: Counter[str]) -> str | None:
    """Return a sentence that says how many trials are left out and why; None if no trial is left out."""
    parts = [f"{left_out[standing]} {reason}" for standing, reason in _REASONS.items() if left_out[standing]]
    if not parts:
        return None
    listed = "; ".join(parts)
    return f"Trials left out: {listed}."
