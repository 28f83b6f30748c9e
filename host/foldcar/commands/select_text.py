"""Prints which designs to build: the answer first, then a table, reasons, environments and what it rests on."""

from collections.abc import Sequence

from rich.console import Console

from foldcar.advice.selecting import BASIS, Selection
from foldcar.analysis.rate import Rate
from foldcar.analysis.words import points
from foldcar.shown_console import ResultTable, shown_console

PLAIN_WIDTH = 200


def print_selections(found: Sequence[Selection]) -> None:
    """Print the advice for each experiment."""
    console = shown_console(PLAIN_WIDTH)
    if not found:
        console.print("Nothing to select: the store has no runs yet; sweep the listing into it with `foldcar sweep`.")
    for number, one in enumerate(found):
        if number:
            console.print()
        if len(found) > 1:
            console.print(f"Experiment {one.info.id}", style="bold")
        console.print(one.sentence, style="bold")
        if one.recommendations:
            _print_designs(console, one)
        for remark in one.remarks:
            console.print(remark)


def _print_designs(console: Console, one: Selection) -> None:
    table = ResultTable()
    expected = any(design.expected is not None for design in one.recommendations)
    heads = ["design", "simulated %", *["expected %"] * expected, "trials", "sheets", "minutes", "why"]
    for head in heads:
        table.add_column(head, right=head not in ("design", "why"), no_wrap=head != "why")
    for design in one.recommendations:
        price = design.cost
        cells = [design.label, _rate(design.simulated), *[_rate(design.expected)] * expected]
        cells += [f"{design.trials} more" if design.trials_done else str(design.trials)]
        cells += ["-" if price is None else str(price.sheets), "-" if price is None else str(price.minutes)]
        table.add_row(*cells, design.reason)
    table.print_on(console)
    half = points(one.precision, sign=False)
    console.print(f"Trials: until a rate is known to ±{half} points (95 %), averaged over what it may be.")
    if one.environments:
        samples = ", ".join(map(str, one.environments))
        telling = f"the first {one.telling} tell" if one.telling else "none tells"
        console.print(
            f"Environments to set up, the same for all (`foldcar log --sample K`): {samples}. They stand for all sampled "
            f"ones; {telling} these designs apart in {one.info.simulation}.",
        )
    if any(design.cost is not None for design in one.recommendations):
        console.print(BASIS)


def _rate(rate: Rate | None) -> str:
    if rate is None:
        return "-"
    return f"{100 * rate.value:.0f} ({100 * rate.low:.0f}–{100 * rate.high:.0f})"
