"""Stores the end of a trial at once, with the person's outcome; completes trials whose session was killed.

Input: the end of a drive, answers. Output: the completed row of the trial.
"""

from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.link.tlog import log_damage
from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.trial_records import INTERRUPTED, Ending, ending_without_outcome
from foldcar.store.trial_writer import TrialWriter
from foldcar.trials.drive_end import DriveEnd
from foldcar.trials.person import PersonAnswers, print_line

OUTCOME_KEYS = {
    "p": "passed",
    "t": "tipped",
    "s": "stuck",
    "o": "off_course",
    "i": "timeout",
    "n": "not_passed",
    "a": "aborted",
}
OUTCOME_QUESTION = "Outcome: (p)assed, (t)ipped, (s)tuck, (o)ff course, t(i)me limit, (a)borted"


def store_end(writer: TrialWriter, number: int, end: DriveEnd, log: Path) -> str | None:
    """Store how a trial ended, before a person is asked for its outcome. Return the hash of its log, if there is a log.

    So the trial is kept even if the program ends before the person has answered. Until then, a trial without an outcome
    counts as aborted, and an aborted trial is in no success rate. Raises StoreError.
    """
    digest = sha256_of(log)
    if end.outcome is None:
        outcome, ending = "aborted", ending_without_outcome(end.ending)
    else:
        outcome, ending = end.outcome, end.ending
    stored_ending = Ending(
        outcome=outcome,
        ending=ending,
        elapsed_time_s=end.elapsed_time_s,
        note="",
        log_sha256=digest,
    )
    try:
        writer.complete(number, stored_ending)
    except StoreError as error:
        advice = f"trial {number} is stored without its outcome; enter it later with `foldcar trials correct`"
        raise StoreError(f"{error}; {advice}") from error
    return digest


def record_outcome(
    writer: TrialWriter, number: int, end: DriveEnd, log: Path, digest: str | None, outcome: str | None,
    note: str | None, answers: PersonAnswers | None, mark: str = "",
) -> Ending:  # fmt: skip
    """Find out the outcome of trial ``number``, store and print it, and return what was stored.

    ``outcome`` and ``note`` are those of the command's options, or None; ``answers`` are those of a person, or None if
    nobody is asked. ``digest`` is the hash of the trial's log. ``mark`` is printed behind the outcome. Raises
    FoldcarError if the outcome remains unknown, or if the log has disappeared.
    """
    elapsed_text = f" after {end.elapsed_time_s:.2f} s" if end.elapsed_time_s is not None else ""
    print_line(f"Ended{elapsed_text}: {end.ending}")
    final_outcome = _final_outcome(end, outcome, answers)
    if final_outcome is None:
        raise FoldcarError(f"trial {number}: {end.ending}: its outcome is unknown; with --yes, give it by --outcome")
    final_ending = Ending(
        outcome=final_outcome,
        ending=end.ending,
        elapsed_time_s=end.elapsed_time_s,
        note=note or "",
        log_sha256=digest,
    )
    try:
        writer.complete(number, final_ending)
    except StoreError as error:
        advice = f"enter {final_outcome} later with `foldcar trials correct`"
        raise StoreError(f"{error}; trial {number} remains stored as {end.outcome or 'aborted'}; {advice}") from error
    print_line(f"Trial {number}: {final_outcome}{mark}; log: {log if digest else 'none'}")
    if digest is None and end.error is None:
        raise FoldcarError(f"{log}: was deleted or moved; trial {number} is stored without its log")
    return final_ending


def _final_outcome(end: DriveEnd, option: str | None, answers: PersonAnswers | None) -> str | None:
    """Return the outcome of a trial whose drive ended with ``end``, or None if it is unknown.

    ``option`` is the outcome that the command's options give, or None. A drive that failed is aborted, whatever the
    option says. If there is no option, the person is asked; the outcome of the drive itself is then the default.
    """
    if end.error is not None:
        return "aborted"
    if option is not None:
        return "aborted" if end.outcome == "aborted" else option
    if answers is None:
        return end.outcome
    default_text = f" [{end.outcome}]" if end.outcome else ""
    return answers.choice(f"{OUTCOME_QUESTION}{default_text}: ", OUTCOME_KEYS, end.outcome)


def complete_interrupted(writer: TrialWriter) -> None:
    """Complete the trials whose session was killed, as aborted unless a correction says otherwise."""
    for number, log, outcome in writer.unfinished():
        log_path = log_file(writer.path, log)
        digest = sha256_of(log_path)
        ending = Ending(outcome=outcome, ending=INTERRUPTED, elapsed_time_s=None, note="", log_sha256=digest)
        writer.complete(number, ending)
        damage = log_damage(log_path) if digest else None
        damage_text = f"; {damage}" if damage else ""
        print_line(f"Trial {number} was interrupted: it counts as {outcome}; its log is kept{damage_text}")
