"""`foldcar crosscheck`: sweeps a listing in all engines and compares the results."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import Components, Json, output_folder, print_json
from foldcar.installation import usable_processors
from foldcar.study.limits import MOST_ENVIRONMENTS, MOST_JOBS

if TYPE_CHECKING:
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.crosscheck.agreement import Agreement
    from foldcar.study.experiment_runs import Progress

STORE = "study.db"


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

    The same cars with the same firmware in the same scenes, swept into DIR/study.db (needs `make mujoco`); in the side
    view those experiments whose ground, way and cars are alike on both sides. It may be stopped at any time: the same
    command resumes it.

    \b
    Example: foldcar crosscheck scenarios/step_pyramids.json -o check
    """
    from foldcar.commands.progress_bar import TerminalBar
    from foldcar.crosscheck.page import PAGE, comparison_numbers, write_page
    from foldcar.crosscheck.sweeps import check_success, simulators, sweep_all
    from foldcar.interrupts import said
    from foldcar.outputs import make_output_folder
    from foldcar.store.reader import Store
    from foldcar.study.experiments import read_study

    carsims = simulators(baseline)
    study = read_study(listing, experiment, environments)
    check_success(study)
    workers = jobs or usable_processors()
    command = shlex.join(["foldcar", *sys.argv[1:]])
    with said(lambda: f"stopped: finished runs are in {output / STORE}; the same command resumes"):
        make_output_folder(output)
        sweep_all(study, output / STORE, carsims, baseline, workers, command, _bar)
        names = [one.id for one in study.experiments]
        with Store.open(output / STORE) as store, TerminalBar("pictures", len(names)) as bar:
            comparisons = write_page(output, listing.name, store, names, baseline, carsims, workers, bar.done)
    if as_json:
        print_json({"page": output / PAGE, "comparisons": {name: comparison_numbers(one) for name, one in comparisons}})
        return
    _print(comparisons)
    typer.echo(f"page: {output / PAGE}")


def _bar(progress: "Progress", engine: str) -> "ProgressBar":
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.crosscheck.page import NAMES

    return ProgressBar(progress, label=NAMES[engine])


def _print(comparisons: "list[tuple[str, Agreement]]") -> None:
    from foldcar.crosscheck.page import COMPARISON_HEAD, comparison_row
    from foldcar.shown_console import ResultTable, shown_console

    table = ResultTable()
    for index, head in enumerate(COMPARISON_HEAD):
        # On a narrow terminal names wrap, so that numbers are not truncated.
        if index:
            table.add_column(head, right=True, no_wrap=True, min_width=len(head))
        else:
            table.add_column(head, min_width=12)
    for name, one in comparisons:
        table.add_row(*comparison_row(name, one))
    table.print_on(shown_console(160))
