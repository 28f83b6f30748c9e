"""`foldcar crosscheck`: sweeps a listing in all engines and compares the results."""

from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import (
    Components,
    Environments,
    Jobs,
    Json,
    Listing,
    OneExperiment,
    OutputFolder,
    command_line,
    tell,
)
from foldcar.installation import usable_processors
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.report.crosscheck_agreement import Agreement
    from foldcar.study.experiment_runs import Progress

STORE = "study.db"


def crosscheck(
    listing: Listing,
    output: OutputFolder,
    experiment: OneExperiment = None,
    environments: Environments = None,
    baseline: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            max=MOST_ENVIRONMENTS,
            help="Samples that MuJoCo also runs at half step and with other tyres.",
        ),
    ] = 10,
    jobs: Jobs = None,
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
    from foldcar.interrupts import said
    from foldcar.outputs import make_output_folder
    from foldcar.report.crosscheck_page import PAGE, comparison_numbers, write_page
    from foldcar.report.crosscheck_sweeps import check_success, simulators, sweep_all
    from foldcar.store.reader import Store
    from foldcar.study.experiments import read_study

    carsims = simulators(baseline)
    study = read_study(listing, experiment, environments)
    check_success(study)
    workers = jobs or usable_processors()
    with said(lambda: f"stopped: finished runs are in {output / STORE}; the same command resumes"):
        make_output_folder(output)
        sweep_all(study, output / STORE, carsims, baseline, workers, command_line(), _bar)
        names = [one.id for one in study.experiments]
        with Store.open(output / STORE) as store, TerminalBar("pictures", len(names)) as bar:
            comparisons = write_page(output, listing.name, store, names, baseline, carsims, workers, bar.done)
    if as_json:
        numbers = {name: comparison_numbers(one) for name, one in comparisons}
        tell(as_json, {"page": output / PAGE, "comparisons": numbers})
        return
    _print(comparisons)
    typer.echo(f"page: {output / PAGE}")


def _bar(progress: "Progress", engine: str) -> "ProgressBar":
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.report.crosscheck_page import NAMES

    return ProgressBar(progress, label=NAMES[engine])


def _print(comparisons: "list[tuple[str, Agreement]]") -> None:
    from foldcar.report.crosscheck_page import COMPARISON_HEAD, comparison_row
    from foldcar.shown_console import ResultTable, shown_console

    table = ResultTable(*COMPARISON_HEAD, left=COMPARISON_HEAD[:1])
    for name, one in comparisons:
        table.add_row(*comparison_row(name, one))
    table.print_on(shown_console(160))
