"""Prints the report's summary from the page's data: what it says, and its designs as a table."""

from collections.abc import Iterator, Mapping
from typing import Any

from foldcar.analysis.words import rate_text
from foldcar.shown_console import ResultTable, shown_console

PIPED_WIDTH = 160
# Designs that are listed; of more the export has all.
MOST_DESIGNS = 60
# What the summary as an object leaves to the page.
PAGE_ONLY = ("runs", "runs_omitted", "replay", "replays", "files", "environment", "provenance", "outcome_labels")


def print_summary(data: Mapping[str, Any]) -> None:
    """Print every experiment's headline, advice, remarks and table of designs; plain text if not on a terminal."""
    console = shown_console(PIPED_WIDTH)
    for one in data["experiments"]:
        console.print(f"Experiment {one['id']}", style="bold")
        for line in _lines(one):
            console.print(line)
        if one["designs"]["name"]:
            _table(one).print_on(console)


def summary_object(data: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The experiments without what only the page needs: what `foldcar report --json` prints. Shares are 0 to 1."""
    return [{key: value for key, value in one.items() if key not in PAGE_ONLY} for one in data["experiments"]]


def _lines(one: Mapping[str, Any]) -> Iterator[str]:
    yield one["headline"]
    for label, said in (("Most likely to work", one["likely"]["text"]), ("To learn most, drive", one["learn"]["text"])):
        if said:
            yield f"{label}: {said}"
    yield from one["edge"]
    if one["importance"]:
        shares = [
            f"{one['parameters'][row['parameter']]['label']} {rate_text(row['share'], row['low'], row['high'])}"
            for row in one["importance"]
        ]
        yield f"Importance (share of the variance of success): {', '.join(shares)}."
    told = [row for row in one["causes"] if row["low"] > 0][:3]
    if told:
        names = [f"{row['label']} ({row['separation']:.2f})" for row in told]
        yield f"What separates passed from failed runs of a design (0 to 1): {', '.join(names)}."
    yield from one["remarks"]
    number = len(one["designs"]["name"])
    if number > MOST_DESIGNS:
        yield f"The first {MOST_DESIGNS} of {number:,} designs; `foldcar export` has all runs."


def _table(one: Mapping[str, Any]) -> ResultTable:
    designs = one["designs"]
    driven = any(designs["trials"])
    seen = [code for code, column in enumerate(designs["outcomes"]) if code and any(column)]
    titles = ["runs", "passed %", "95 % interval", *["trials", "cars", "trials and simulation %"] * driven]
    table = ResultTable("design", *titles, *(one["outcome_labels"][code] for code in seen))
    for at, name in enumerate(designs["name"][:MOST_DESIGNS]):
        cells = [str(designs["runs"][at]), *_rate(one, at)]
        if driven:
            trials = designs["trials"][at]
            believed = [designs[key][at] for key in ("belief", "belief_low", "belief_high")]
            cells.append(f"{designs['trials_passed'][at]} of {trials}" if trials else "-")
            cells.append(str(designs["cars"][at] or "-"))
            cells.append("-" if believed[0] is None else "{:.0f} ({:.0f} - {:.0f})".format(*(100 * x for x in believed)))
        table.add_row(name, *cells, *(str(designs["outcomes"][code][at]) for code in seen))
    return table


def _rate(one: Mapping[str, Any], at: int) -> tuple[str, str]:
    designs = one["designs"]
    if not one["judged"]:
        return "undefined", "-"
    if designs["low"][at] is None:
        return "-", "-"
    return f"{100 * designs['rate'][at]:.1f}", f"{100 * designs['low'][at]:.1f} - {100 * designs['high'][at]:.1f}"
