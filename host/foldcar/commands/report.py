"""`foldcar report`: writes a page with figures of a store's study, and prints a summary."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.json_option import Json, print_json
from foldcar.commands.output_option import output_folder
from foldcar.commands.simulated_trials_option import SimulatedTrials


def report(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store that a sweep wrote.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the page and its figures."
        ),
    ],
    simulated_trials: SimulatedTrials = False,
    as_json: Json = False,
) -> None:
    """Draw a report of a study, or of trials alone.

    Prints its summary. DIR/index.html is the page; each figure stands beside it as SVG, PNG and PDF.

    \b
    Example: foldcar report study.db -o report
    """
    from foldcar.report.summary_object import summary_object, trials_object
    from foldcar.report.terminal import print_summary
    from foldcar.report.write import PAGE, write_report
    from foldcar.store.reader import Store

    command = ["foldcar", "report", str(store), "-o", str(output)]
    if simulated_trials:
        command.append("--simulated-trials")
    with Store.open(store) as opened:
        sections, driven = write_report(opened, output, command, simulated_trials)
    if as_json:
        experiments, only_trials = [summary_object(one) for one in sections], [trials_object(one) for one in driven]
        print_json({"store": store, "page": output / PAGE, "experiments": experiments, "trials": only_trials})
        return
    print_summary(sections, driven)
    typer.echo(f"report: {output / PAGE}")
