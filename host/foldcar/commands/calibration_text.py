"""A calibration printed: parameters with priors, designs with predictions, findings."""

from collections.abc import Mapping
from typing import Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from foldcar.analysis.words import design_text
from foldcar.shown_console import shown_console
from foldcar.store.calibrations import Calibration

PIPED_WIDTH = 160


def print_calibration(calibration: Calibration) -> None:
    """Print its summary; intervals are of 90 %."""
    summary = calibration.summary
    console = shown_console(PIPED_WIDTH)
    head = f"Experiment {summary['experiment']}, {summary['runs']} runs; ranges are 90 % intervals"
    console.print(head, style="bold")
    for note in summary["notes"]:
        typer.echo(note)
    table = _table(console, "parameter", "before the trials", "after", "told %")
    for one in summary["parameters"]:
        explained = "-" if one["explained"] is None else f"{100 * one['explained']:.0f}"
        name = one["name"] if one["name"].endswith(f"_{one['unit']}") else f"{one['name']} ({one['unit']})"
        table.add_row(name, _median(one["prior"]), _median(one["posterior"]), explained)
    console.print(table)
    table = _table(console, "design", "trials", "passed %", "nominal", "calibrated", "predicted")
    for one in summary["designs"]:
        nominal = "-" if one["nominal"] is None else f"{100 * one['nominal']:.0f}"
        share, trials = f"{100 * one['passed'] / one['counted']:.0f}", f"{one['passed']}/{one['counted']}"
        calibrated = f"{100 * one['simulated']['median']:.0f} ({_percent(one['simulated'])})"
        table.add_row(design_text(one["design"]), trials, share, nominal, calibrated, _percent(one["predicted"]))
    console.print(table)
    if summary.get("leave_one_out"):
        table = _table(console, "left out", "trials", "passed %", "predicted", "log score", "nominal")
        for one in summary["leave_one_out"]:
            nominal = "-" if one["nominal_log_score"] is None else f"{one['nominal_log_score']:.2f}"
            share = f"{100 * one['passed'] / one['counted']:.0f}"
            trials = f"{one['passed']}/{one['counted']}"
            table.add_row(
                design_text(one["design"]), trials, share, _percent(one["predicted"]), f"{one['log_score']:.2f}", nominal
            )
        console.print(table)
    likelihood = summary["log_likelihood"]
    nominal = "" if likelihood["nominal"] is None else f", nominal {likelihood['nominal']:.1f}"
    typer.echo(f"log-likelihood {likelihood['expected']:.1f}{nominal}, best possible {likelihood['best']:.1f}")
    for finding in summary["findings"]:
        typer.echo(finding)


def _table(console: Console, *columns: str) -> Table:
    table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index else "left", no_wrap=True)
    return table


def _median(ends: Mapping[str, Any]) -> str:
    # Millimetres and milliradians are the last digits that matter.
    middle, low, high = (f"{round(ends[name], 3):.2g}" for name in ("median", "low", "high"))
    return f"{middle} ({low}..{high})"


def _percent(ends: Mapping[str, Any]) -> str:
    return f"{100 * ends['low']:.0f} - {100 * ends['high']:.0f}"
