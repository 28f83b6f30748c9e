"""`foldcar report`: writes a page with figures of a store's study, and prints a summary."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.simulated_trials_option import SimulatedTrials


def report(
    store: Annotated[Path, typer.Argument(help="results store", metavar="STORE")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="folder for the page and its figures", metavar="DIR")
    ],
    simulated_trials: SimulatedTrials = False,
) -> None:
    """Draw the report of a study, or of trials alone: DIR/index.html, and each figure as SVG and PNG."""
    from foldcar.report.terminal import print_summary
    from foldcar.report.write import PAGE, write_report
    from foldcar.store.reader import Store

    command = ["foldcar", "report", str(store), "-o", str(output)]
    if simulated_trials:
        command.append("--simulated-trials")
    with Store.open(store) as opened:
        sections, driven = write_report(opened, output, command, simulated_trials)
    print_summary(sections, driven)
    typer.echo(f"report: {output / PAGE}")
