"""Records a trial's outcome: first what is known when the drive ends, then the person's answers.

Input: the end of a drive, typed answers. Output: the completed row of the trial in the store.
"""

import hashlib
from pathlib import Path

import typer

from foldcar.commands.log_options import LogOptions
from foldcar.commands.typed_answers import TypedAnswers
from foldcar.errors import FoldcarError
from foldcar.store.errors import StoreError
from foldcar.store.kept_work import keep_trial, kept_trial
from foldcar.store.trial_records import Ending, not_entered
from foldcar.store.trial_writer import TrialWriter
from foldcar.trials.driving import DriveEnd

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
    writer: TrialWriter,
    number: int,
    end: DriveEnd,
    log: Path,
    options: LogOptions,
    answers: TypedAnswers,
    mark: str = "",
) -> None:
    """Complete the row of trial ``number`` and say so, with the ``mark`` of a simulated car.

    FoldcarError if its outcome is unknown and may not be asked for.
    """
    digest = log_hash(log)
    ending = end.ending if end.outcome else not_entered(end.ending)
    try:
        _complete(writer, number, log, Ending(end.outcome or "aborted", ending, end.elapsed_time_s, "", digest))
    except StoreError as error:
        # The person is asked nevertheless, and the answers are kept too.
        typer.echo(f"{error}", err=True)
    drove = f" after {end.elapsed_time_s:.2f} s" if end.elapsed_time_s is not None else ""
    typer.echo(f"Ended{drove}: {end.ending}")
    outcome = _outcome(number, end, options, answers)
    note = options.note or ""
    if options.note is None and not options.yes and end.error is None:
        note = answers.line("Note (Enter for none): ")
    _complete(writer, number, log, Ending(outcome, end.ending, end.elapsed_time_s, note, digest))
    typer.echo(f"Trial {number}: {outcome}{mark}; log: {log if digest else 'none'}")
    if digest is None and end.error is None:
        raise FoldcarError(f"{log}: is gone: it was deleted or moved; trial {number} is stored without its log")


def _complete(writer: TrialWriter, number: int, log: Path, ending: Ending) -> None:
    """Store the end of a trial. If that fails, keep it in a file beside the store, which the StoreError names."""
    try:
        writer.complete(number, ending)
    except (StoreError, KeyboardInterrupt) as error:
        # Ctrl-C may have ended the wait for another program, or come after the end was stored.
        if isinstance(error, KeyboardInterrupt) and writer.has_ended(number, ending):
            raise
        kept = keep_trial(writer.path, number, str(log.relative_to(writer.path.parent)), ending)
        if isinstance(error, KeyboardInterrupt):
            typer.echo(kept, err=True)
            raise
        raise StoreError(f"{error}; {kept}") from error
    kept_trial(writer.path, number).unlink(missing_ok=True)


def log_hash(log: Path) -> str | None:
    """SHA-256 of a log in hexadecimal digits; None if the file is missing."""
    return hashlib.sha256(log.read_bytes()).hexdigest() if log.is_file() else None


def _outcome(number: int, end: DriveEnd, options: LogOptions, answers: TypedAnswers) -> str:
    if end.error is not None:
        return "aborted"
    if options.outcome is not None:
        return options.outcome
    if not options.yes:
        suggested = f" [{end.outcome}]" if end.outcome else ""
        return answers.choice(f"{OUTCOME_QUESTION}{suggested}: ", OUTCOME_KEYS, end.outcome)
    if end.outcome is None:
        raise FoldcarError(f"trial {number}: {end.ending}: its outcome does not follow; use --outcome with --yes")
    return end.outcome
