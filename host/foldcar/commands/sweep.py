"""`foldcar sweep`: simulates every design of a listing in every environment into a store."""

import os
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.components_option import Components


def sweep(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    store: Annotated[Path, typer.Option(metavar="FILE", help="Store to write; created if missing.")],
    environments: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Sampled environments, instead of the listing's number."),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, max=256, help="Simulators in parallel; default: one per processor."),
    ] = None,
    experiment: Annotated[str | None, typer.Option(metavar="ID", help="Only this experiment.")] = None,
    components: Components = None,
) -> None:
    """Simulate all runs that the store lacks. It may be stopped at any time: the same command resumes it."""
    from foldcar.commands.progress_bar import ProgressBar
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.environments import mutation_notes
    from foldcar.study.experiments import read_study
    from foldcar.study.sweep import Progress, planned_total
    from foldcar.study.sweep import sweep as run_sweep

    study = read_study(listing, experiment, environments)
    carsim = Carsim()
    for note in mutation_notes(study.experiments):
        typer.echo(f"note: {note}", err=True)
    progress = Progress(total=planned_total(study))
    command = shlex.join(["foldcar", *sys.argv[1:]])
    try:
        with ProgressBar(progress) as bar:
            run_sweep(
                study, store, carsim, jobs or len(os.sched_getaffinity(0)), command, bar.update, progress
            )
    except KeyboardInterrupt:
        typer.echo(
            f"stopped: {progress.done} of {progress.total} runs are stored in {store}; "
            "the same command resumes",
            err=True,
        )
        raise typer.Exit(130) from None
    rate = f", {progress.new / progress.seconds:.0f} runs/s" if progress.new else ""
    failed = f", {progress.failed} failed" if progress.failed else ""
    typer.echo(
        f"{progress.new} runs new, {progress.there} there already, {progress.seconds:.1f} s{rate}, "
        f"{100 * progress.passed / progress.total:.1f} % passed{failed}; store: {store}"
    )
