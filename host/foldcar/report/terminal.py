"""The report's summary on the terminal: a table per experiment, without ornament where it is piped."""

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from foldcar.figures.style import OUTCOME_LABELS
from foldcar.report.axis import parameter_label, value_text
from foldcar.report.sections import Section
from foldcar.report.series import Tally
from foldcar.results import OUTCOMES

PIPED_WIDTH = 160


def print_summary(sections: Sequence[Section]) -> None:
    """Print every experiment's remarks and tables."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=PIPED_WIDTH)
    for section in sections:
        info, total = section.info, section.summary.total
        console.print(
            f"Experiment {info.id}: {info.vehicle_type} in {info.scenic_program}", markup=False, style="bold"
        )
        for remark in section.remarks:
            console.print(remark, markup=False)
        # Outcomes that never happened are no columns here; the page has them all.
        seen = [outcome for outcome in OUTCOMES[1:] if total.outcomes[outcome]]
        for series in section.summary.series:
            rows = [(value_text(value), tally) for value, tally in series.tallies.items()]
            console.print(_table(console, parameter_label(series.parameter), [*rows, ("all", total)], seen))
        if not section.summary.series:
            console.print(_table(console, "design", [("all", total)], seen))


def _table(console: Console, first: str, rows: Sequence[tuple[str, Tally]], outcomes: Sequence[str]) -> Table:
    table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)
    columns = [first, "runs", "passed %", "95 % interval", "mean time (s)"]
    for column in [*columns, *(OUTCOME_LABELS[outcome] for outcome in outcomes)]:
        table.add_column(column, justify="right", no_wrap=True)
    for name, tally in rows:
        if not tally.runs:
            continue
        low, high = tally.interval
        table.add_row(
            name,
            str(tally.runs),
            f"{100 * tally.success:.1f}",
            f"{100 * low:.1f} - {100 * high:.1f}",
            "-" if tally.mean_time_s is None else f"{tally.mean_time_s:.2f}",
            *(str(tally.outcomes[outcome]) for outcome in outcomes),
        )
    return table
