"""`foldcar crosscheck`: a listing's runs in carsim and in MuJoCo, and how far they agree."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.components_option import Components

if TYPE_CHECKING:
    from foldcar.crosscheck.agreement import Agreement


def crosscheck(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the results.")],
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
    environments: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Sampled environments, instead of the listing's number."),
    ] = None,
    yardstick: Annotated[
        int,
        typer.Option(
            metavar="N", min=0, help="Samples that MuJoCo also runs at half step and with other tyres."
        ),
    ] = 10,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, max=256, help="Processes; one a processor if not given.")
    ] = None,
    components: Components = None,
) -> None:
    """Run every car in every environment in a second engine too. Stop it any time: it goes on from there."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from foldcar.carsim import Carsim
    from foldcar.crosscheck.cases import cases_of
    from foldcar.crosscheck.compare import compare, planned_runs
    from foldcar.crosscheck.mujoco_run import import_mujoco
    from foldcar.crosscheck.page import PAGE, write_page
    from foldcar.crosscheck.result_cache import ResultCache
    from foldcar.errors import FoldcarError
    from foldcar.experiments import read_study

    import_mujoco()
    study = read_study(listing, experiment, environments)
    carsim = Carsim()
    cases = list(cases_of(study, carsim))
    if output.exists() and not output.is_dir():
        raise FoldcarError(f"{output}: is no folder")
    output.mkdir(parents=True, exist_ok=True)
    console = Console(stderr=True)
    columns = (TextColumn("crosscheck"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    try:
        with (
            ResultCache(output / "results.jsonl") as cache,
            Progress(*columns, console=console, disable=not console.is_terminal) as bar,
        ):
            task = bar.add_task("runs", total=planned_runs(cases, yardstick))
            results = compare(
                cases,
                carsim,
                cache,
                jobs or len(os.sched_getaffinity(0)),
                yardstick,
                lambda count: bar.advance(task, count),
            )
    except KeyboardInterrupt:
        typer.echo(f"stopped: what is done is in {output}; the same command goes on from there", err=True)
        raise typer.Exit(130) from None
    comparisons = write_page(output, listing.name, cases, results, yardstick, carsim)
    _print(comparisons)
    typer.echo(f"page: {output / PAGE}")


def _print(comparisons: "list[tuple[str, Agreement]]") -> None:
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    from foldcar.crosscheck.page import COMPARISON_HEAD, comparison_row

    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=160)
    table = Table(box=SIMPLE_HEAD if console.is_terminal else None, pad_edge=False)
    for index, head in enumerate(COMPARISON_HEAD):
        table.add_column(head, justify="right" if index else "left", no_wrap=True)
    for name, one in comparisons:
        table.add_row(*comparison_row(name, one))
    console.print(table)
