"""Prints the report's summary: a table for each experiment, as plain text if the output is not a terminal."""

from collections.abc import Sequence

from rich.console import Console

from foldcar.figures.style import OUTCOME_LABELS
from foldcar.report.axis import extent_text, interval_text, parameter_label, success_text, value_text
from foldcar.report.sections import Section
from foldcar.report.series import Tally
from foldcar.report.trial_sections import TrialSection
from foldcar.report.trial_series import TrialGroup, TrialTally
from foldcar.shown_console import ResultTable, shown_console

PIPED_WIDTH = 160


def print_summary(sections: Sequence[Section], driven: Sequence[TrialSection]) -> None:
    """Print every experiment's remarks and tables; ``driven`` are experiments with trials only."""
    console = shown_console(PIPED_WIDTH)
    for section in sections:
        info, total = section.info, section.summary.total
        console.print(
            f"Experiment {info.id}: {info.vehicle_type} in {info.scenic_program}", style="bold"
        )
        console.print(f"Rule: {info.success_rule}.")
        for remark in section.remarks:
            console.print(remark)
        tables = [
            (
                parameter_label(series.parameter),
                [(value_text(v), tally) for v, tally in series.tallies.items()],
            )
            for series in section.summary.series
        ]
        for first, rows in tables or [("design", [])]:
            rows.append(("all", total))
            _table(first, rows, total.seen[1:]).print_on(console)
            if total.recorded:
                _recorded_table(first, rows, list(total.recorded)).print_on(console)
        _print_trials(console, section.trials.built, section.trials.simulated)
    for alone in driven:
        console.print(f"Experiment {alone.experiment}: {alone.vehicle_type}, trials only", style="bold")
        for remark in alone.remarks:
            console.print(remark)
        _print_trials(console, alone.built, alone.simulated)


def _print_trials(console: Console, built: TrialGroup, simulated: TrialGroup) -> None:
    for group, head in ((built, "trials"), (simulated, "SIMULATED trials")):
        if not group.total.counted and not group.total.aborted:
            continue
        for parameter, by_value in group.series.items() or {"": {}}.items():
            rows = [(value_text(value), tally) for value, tally in by_value.items()]
            _trial_table(parameter_label(parameter), head, [*rows, ("all", group.total)]).print_on(console)


def _trial_table(first: str, head: str, rows: Sequence[tuple[str, TrialTally]]) -> ResultTable:
    table = ResultTable(first, head, "passed %", "95 % interval", "aborted")
    for name, tally in rows:
        shares = ("-", "-")
        if tally.counted:
            low, high = tally.interval
            shares = (f"{100 * tally.success:.1f}", f"{100 * low:.1f} - {100 * high:.1f}")
        table.add_row(name, str(tally.counted), *shares, str(tally.aborted))
    return table


def _recorded_table(first: str, rows: Sequence[tuple[str, Tally]], names: Sequence[str]) -> ResultTable:
    table = ResultTable(first, *(f"recorded {name}" for name in names))
    for name, tally in rows:
        table.add_row(name, *(extent_text(tally.recorded.get(recorded)) for recorded in names))
    return table


def _table(first: str, rows: Sequence[tuple[str, Tally]], outcomes: Sequence[str]) -> ResultTable:
    heads = (first, "runs", "passed %", "95 % interval", "mean time (s)")
    table = ResultTable(*heads, *(OUTCOME_LABELS[outcome] for outcome in outcomes))
    for name, tally in rows:
        if not tally.runs:
            continue
        table.add_row(
            name,
            str(tally.runs),
            success_text(tally),
            interval_text(tally.interval).replace("–", "-"),
            "-" if tally.mean_time_s is None else f"{tally.mean_time_s:.2f}",
            *(str(tally.outcomes[outcome]) for outcome in outcomes),
        )
    return table
