"""What `foldcar optimize` prints of a search: lines and a table, or an object."""

import math
from collections.abc import Sequence
from pathlib import Path

import typer

from foldcar.search.objectives import Interval, Objective
from foldcar.search.search import Found, Plan
from foldcar.shown_console import ResultTable, shown_console

SHOWN_UNBUILDABLE = 5
PLAIN_WIDTH = 400


def search_object(plan: Plan, found: Found, store: Path, experiment: str) -> dict[str, object]:
    """What a search found, for `--json`."""
    names = [one.name for one in plan.objectives]
    return {
        "store": store,
        "experiment": experiment,
        "objectives": names,
        "designs": found.designs,
        "pruned": found.pruned,
        "unbuildable": found.unbuildable,
        "runs": found.runs,
        "new": found.new,
        "exhausted": found.exhausted,
        "seconds": round(found.seconds, 3),
        "best": [
            {
                "design": one.design,
                "chosen_by": dict(zip(names, one.chosen_by, strict=True)),
                "fresh": {
                    name: {"value": value, "interval": interval}
                    for name, value, interval in zip(names, one.fresh, one.intervals, strict=True)
                },
            }
            for one in found.best
        ],
    }


def print_search(plan: Plan, found: Found, store: Path, varied: Sequence[str]) -> None:
    """Print counts, what cannot be built, and the best designs by their ``varied`` parameters (columns)."""
    pruned = f", {found.pruned} left early" if found.pruned else ""
    ended = "; no other design was found to try" if found.exhausted else ""
    typer.echo(
        f"{found.designs} designs tried in {found.runs} runs{pruned}{ended}; "
        f"{found.new} runs new, {found.seconds:.1f} s; store: {store}"
    )
    reasons = list(found.unbuildable.items())
    if reasons:
        typer.echo(f"proposed cars that cannot be built, or have no rate: {len(reasons)}")
        for name, reason in reasons[:SHOWN_UNBUILDABLE]:
            typer.echo(f"  {name}: {reason}")
        if len(reasons) > SHOWN_UNBUILDABLE:
            typer.echo(f"  and {len(reasons) - SHOWN_UNBUILDABLE} more")
    if not found.best:
        typer.echo("no design was tried in all environments: nothing to judge")
        return
    few = "of one objective" if len(plan.objectives) == 1 else "that none beats in all objectives"
    typer.echo(f"\nThe best {few}, judged in {plan.fresh} fresh environments (95 % intervals):")
    table = ResultTable()
    for name in varied:
        table.add_column(name, right=True)
    for chosen in plan.objectives:
        table.add_column(f"{chosen.name}, fresh")
        if chosen.value is not None:
            table.add_column("when chosen")
    for one in found.best:
        cells = [f"{one.design[name]:g}" for name in varied]
        for index, chosen in enumerate(plan.objectives):
            cells.append(_text(chosen, one.fresh[index], one.intervals[index]))
            if chosen.value is not None:
                cells.append(_text(chosen, one.chosen_by[index], None))
        table.add_row(*cells)
    table.print_on(shown_console(PLAIN_WIDTH))
    typer.echo("Values when chosen are those in the environments that the designs were chosen by: too good, as a rule.")


def _text(objective: Objective, value: float | None, interval: Interval | None) -> str:
    if value is None:
        return "all rejected"
    if interval is None:
        return _number(objective, value) + _unit(objective)
    low, high = (_number(objective, bound) for bound in interval)
    return f"{_number(objective, value)} ({low} to {high}){_unit(objective)}"


def _unit(objective: Objective) -> str:
    return f" {objective.unit or '%'}"


def _number(objective: Objective, value: float) -> str:
    if not math.isfinite(value):
        return "∞"
    return f"{100 * value:.1f}" if not objective.unit else f"{value:.4g}"
