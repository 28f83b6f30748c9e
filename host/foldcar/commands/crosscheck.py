"""`foldcar crosscheck`: simulates a listing's runs in carsim and in MuJoCo and compares the results."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.components_option import Components
from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import output_folder
from foldcar.study.limits import MOST_ENVIRONMENTS, MOST_JOBS

if TYPE_CHECKING:
    from foldcar.crosscheck.agreement import Agreement


def crosscheck(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the results.")
    ],
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
    environments: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=MOST_ENVIRONMENTS,
            help="Sampled environments, instead of the listing's number.",
        ),
    ] = None,
    baseline: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            max=MOST_ENVIRONMENTS,
            help="Samples that MuJoCo also runs at half step and with other tyres.",
        ),
    ] = 10,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, max=MOST_JOBS, help="Processes; default: one per processor.")
    ] = None,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Simulate a listing's runs in MuJoCo too and compare.

    The same cars with the same firmware in the same scenes. It may be stopped at any time: the same command resumes it.

    \b
    Example: foldcar crosscheck scenarios/step_pyramids.json -o check
    """
    from foldcar.commands.terminal_bar import TerminalBar
    from foldcar.crosscheck.cases import cases_of
    from foldcar.crosscheck.compare import compare, planned_runs
    from foldcar.crosscheck.mujoco_car import import_mujoco
    from foldcar.crosscheck.page import PAGE, comparison_numbers, write_page
    from foldcar.crosscheck.result_cache import ResultCache
    from foldcar.interrupts import said
    from foldcar.output_folder import make_output_folder
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.experiments import read_study

    import_mujoco()
    study = read_study(listing, experiment, environments)
    carsim = Carsim()
    with said(lambda: f"stopped: finished runs are in {output}; the same command resumes"):
        cases = list(cases_of(study, carsim))
        make_output_folder(output)
        with (
            ResultCache(output / "results.jsonl") as cache,
            TerminalBar("crosscheck", planned_runs(cases, baseline)) as bar,
        ):
            results = compare(
                cases,
                carsim,
                cache,
                jobs or len(os.sched_getaffinity(0)),
                baseline,
                bar.done,
            )
        comparisons = write_page(output, listing.name, cases, results, baseline, carsim)
    if as_json:
        print_json({"page": output / PAGE, "comparisons": {name: comparison_numbers(one) for name, one in comparisons}})
        return
    _print(comparisons)
    typer.echo(f"page: {output / PAGE}")


def _print(comparisons: "list[tuple[str, Agreement]]") -> None:
    from foldcar.commands.result_table import result_table
    from foldcar.crosscheck.page import COMPARISON_HEAD, comparison_row

    console, table = result_table(160)
    for index, head in enumerate(COMPARISON_HEAD):
        # On a narrow terminal names wrap, so that numbers are not truncated.
        if index:
            table.add_column(head, justify="right", no_wrap=True, min_width=len(head))
        else:
            table.add_column(head, min_width=12)
    for name, one in comparisons:
        table.add_row(*comparison_row(name, one))
    console.print(table)
