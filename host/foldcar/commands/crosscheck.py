"""`foldcar crosscheck`: sweeps a listing in all engines and compares the results."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
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
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.report.crosscheck_agreement import Agreement
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.experiments import Study

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
    from foldcar.interrupts import said
    from foldcar.outputs import make_output_folder
    from foldcar.report.crosscheck_agreement import BASELINE, EVERY, comparison_numbers
    from foldcar.report.crosscheck_page import PAGE, write_page
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.reader import Store
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study

    carsims = {engine: Carsim(engine=engine) for engine in (*EVERY, *(BASELINE if baseline else ()))}
    study = read_study(listing, experiment, environments)
    for one in study.experiments:
        success = Environment(one).success
        if not success.defined:
            raise FoldcarError(f"{one.place}: engines are compared by success, and {success.text}")
    workers = jobs or usable_processors()
    with said(lambda: f"stopped: finished runs are in {output / STORE}; the same command resumes"):
        make_output_folder(output)
        _sweep(study, output / STORE, carsims, baseline, workers)
        names = [one.id for one in study.experiments]
        with Store.open(output / STORE) as store:
            comparisons = write_page(output, listing.name, store, names, list(carsims), baseline)
    if as_json:
        numbers = {name: comparison_numbers(one) for name, one in comparisons.items()}
        tell(as_json, {"page": output / PAGE, "comparisons": numbers})
        return
    _print(comparisons)
    typer.echo(f"page: {output / PAGE}")


def _sweep(study: "Study", store: Path, carsims: "Mapping[str, Carsim]", baseline: int, jobs: int) -> None:
    """Simulate what the store lacks: in the side view only what is alike on both sides, in variants a few samples."""
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.report.crosscheck_agreement import BASELINE, NAMES
    from foldcar.simulation.engines import MULTIBODY, SIDE_VIEW
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import engine_study
    from foldcar.study.sweep import Sweep
    from foldcar.study.unlike_sides import unlike_sides

    for engine, carsim in carsims.items():
        some = study.experiments
        if engine in BASELINE:
            some = tuple(replace(one, environments=min(one.environments, baseline)) for one in some)
        elif engine == SIDE_VIEW:
            some = tuple(one for one in some if not unlike_sides(carsim, one, Environment(one)))
        if some:
            asked = Sweep(engine_study(replace(study, experiments=some), carsim), store, carsim, command_line())
            with ProgressBar(asked.progress, label=NAMES[engine]) as bar:
                # What holds for the listing is said once.
                asked.run(jobs, bar.update, bar.say if engine == MULTIBODY else lambda line: None)


def _print(comparisons: "Mapping[str, Agreement]") -> None:
    from foldcar.report.crosscheck_agreement import COMPARISON_HEAD, comparison_row
    from foldcar.shown_console import ResultTable, shown_console

    table = ResultTable(*COMPARISON_HEAD, left=COMPARISON_HEAD[:1])
    for name, one in comparisons.items():
        table.add_row(*comparison_row(name, one))
    table.print_on(shown_console(160))
