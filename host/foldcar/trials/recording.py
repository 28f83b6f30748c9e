"""The end of a trial that was driven, in the store at once: as the person says it, or as a killed session left it.

Input: the end of a drive, answers. Output: the completed row of the trial.
"""

from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.store.errors import StoreError
from foldcar.store.kept_work import keep_trial, kept_trial, take_in_trial
from foldcar.store.log_files import log_file, sha256_of
from foldcar.store.trial_records import INTERRUPTED, Ending, not_entered
from foldcar.store.trial_writer import TrialWriter
from foldcar.trials.driving import DriveEnd
from foldcar.trials.person import Answers, say, warn

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


def record_outcome(
    writer: TrialWriter, number: int, end: DriveEnd, log: Path, outcome: str | None, note: str | None,
    answers: Answers | None, mark: str = "",
) -> Ending:  # fmt: skip
    """Complete the row of trial ``number`` and say so, with the ``mark`` of a simulated car; gives what was stored.

    ``outcome`` is asked for where it is None, unless ``answers`` is None. FoldcarError if it is unknown and may not be
    asked for.
    """
    digest = sha256_of(log)
    ending = end.ending if end.outcome else not_entered(end.ending)
    try:
        complete(writer, number, log, Ending(end.outcome or "aborted", ending, end.elapsed_time_s, "", digest))
    except StoreError as error:
        # The person is asked nevertheless, and the answers are kept too.
        warn(error)
    drove = f" after {end.elapsed_time_s:.2f} s" if end.elapsed_time_s is not None else ""
    say(f"Ended{drove}: {end.ending}")
    outcome = "aborted" if end.error is not None else outcome
    if outcome is None and answers is not None:
        suggested = f" [{end.outcome}]" if end.outcome else ""
        outcome = answers.choice(f"{OUTCOME_QUESTION}{suggested}: ", OUTCOME_KEYS, end.outcome)
    outcome = outcome or end.outcome
    if outcome is None:
        raise FoldcarError(f"trial {number}: {end.ending}: its outcome does not follow; use --outcome with --yes")
    stored = Ending(outcome, end.ending, end.elapsed_time_s, note or "", digest)
    complete(writer, number, log, stored)
    say(f"Trial {number}: {outcome}{mark}; log: {log if digest else 'none'}")
    if digest is None and end.error is None:
        raise FoldcarError(f"{log}: is gone: it was deleted or moved; trial {number} is stored without its log")
    return stored


def complete(writer: TrialWriter, number: int, log: Path, ending: Ending) -> None:
    """Store the end of a trial. If that fails, keep it in a file beside the store, which the StoreError names."""
    try:
        writer.complete(number, ending)
    except (StoreError, KeyboardInterrupt) as error:
        # Ctrl-C may have ended the wait for another program, or come after the end was stored.
        if isinstance(error, KeyboardInterrupt) and writer.has_ended(number, ending):
            raise
        kept = keep_trial(writer.path, number, str(log.relative_to(writer.path.parent)), ending)
        if isinstance(error, KeyboardInterrupt):
            warn(kept)
            raise
        raise StoreError(f"{error}; {kept}") from error
    kept_trial(writer.path, number).unlink(missing_ok=True)


def complete_interrupted(writer: TrialWriter) -> None:
    """Complete the trials whose session was killed, by what was kept of them or as aborted."""
    for number, log in writer.unfinished():
        kept = kept_trial(writer.path, number)
        if kept.is_file():
            say(f"{take_in_trial(writer, kept)}: taken in from {kept}")
            continue
        digest = sha256_of(log_file(writer.path, log))
        writer.complete(number, Ending("aborted", INTERRUPTED, None, "", digest))
        say(f"Trial {number} was interrupted: it counts as aborted; its log is kept")
