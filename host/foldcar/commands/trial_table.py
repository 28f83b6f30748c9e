"""The table of a store's trials that `foldcar trials list` prints, and the texts of their corrections."""

from collections.abc import Sequence

from foldcar.shown_console import ResultTable, shown_console
from foldcar.store.trial_records import BUILT, SIMULATED, UNKNOWN, WITHDRAWN, Correction, Trial

STANDING_TEXTS = {
    BUILT: "of built cars",
    SIMULATED: "of a simulated car",
    UNKNOWN: "of a car that may be built or simulated",
    WITHDRAWN: "withdrawn",
}


def print_trials(found: Sequence[Trial]) -> None:
    """Print a row for each trial, and how many of each standing passed."""
    console, table = shown_console(200), ResultTable()
    shown = _varying(found)
    heads = ("trial", "experiment", *shown, "sample", "car", "outcome", "time (s)", "ending", "started (UTC)", "note")
    for head in heads:
        table.add_column(head, right=head not in ("car", "outcome", "ending", "note"))
    for trial in found:
        corrected = "*" if trial.corrections else ""
        table.add_row(
            f"{trial.id}{corrected}",
            trial.experiment,
            *(f"{trial.design[name]:g}" if name in trial.design else "-" for name in shown),
            "-" if trial.sample is None else str(trial.sample),
            trial.car or UNKNOWN,
            f"{trial.outcome}, {WITHDRAWN}" if trial.withdrawn else trial.outcome,
            seconds_text(trial.elapsed_time_s),
            trial.ending,
            (trial.started_utc or "-").removesuffix("+00:00").replace("T", " "),
            trial.note or (trial.source or ""),
        )
    table.print_on(console)
    console.print(f"{len(found)} trials")
    for standing, text in STANDING_TEXTS.items():
        some = [trial for trial in found if trial.standing == standing]
        if not some:
            continue
        completed = [trial for trial in some if trial.completed]
        passed = sum(trial.outcome == "passed" for trial in completed)
        tail = "" if standing == BUILT else "; they do not count"
        aborted = len(some) - len(completed)
        console.print(f"{text}: {passed} of {len(completed)} passed, {aborted} aborted{tail}")


def correction_text(one: Correction) -> str:
    """A line that says what was changed of a trial, when, by whom and why."""
    by = f" by {one.operator}" if one.operator else ""
    change = f"{one.field} {_quoted(one.before)} -> {_quoted(one.after)}"
    if one.field == "withdrawn":
        change = "withdrawn" if one.after else "restored"
    return f"* trial {one.trial}: {change} on {one.corrected_utc[:10]}{by}: {one.reason}"


def seconds_text(value: float | None) -> str:
    """A time (s) with two decimals; a dash for none."""
    return "-" if value is None else f"{value:.2f}"


def _varying(found: Sequence[Trial]) -> list[str]:
    """The design parameters in which the trials differ; width if they do not."""
    names = dict.fromkeys(name for trial in found for name in trial.design)
    return [name for name in names if len({trial.design.get(name) for trial in found}) > 1] or list(names)[:1]


def _quoted(value: object) -> str:
    return '"' + value + '"' if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else "none"
