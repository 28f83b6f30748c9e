"""`foldcar report`: writes a page with figures of a store's study and prints a summary, or serves the page."""

import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.live import LAN, LOG, PORT, LivePort, serve
from foldcar.commands.options import Json, SimulatedTrials, StudyStore, output_folder, tell
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors

if TYPE_CHECKING:
    from foldcar.report.figure_options import FigureOptions
    from foldcar.report.live import LiveStudy
    from foldcar.simulation.carsim import Carsim


def report(
    store: StudyStore,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the files.")
    ] = None,
    live: Annotated[
        bool,
        typer.Option("--live", help="Serve the page to this machine's browser; it follows the store; until Ctrl-C."),
    ] = False,
    port: LivePort = None,
    simulated_trials: SimulatedTrials = False,
    threshold: Annotated[
        list[float] | None,
        typer.Option(
            metavar="SHARE",
            min=0.01,
            max=0.99,
            help="Success of good designs, 0 to 1; may be repeated. Default: the listing's, or 0.5 and 0.75.",
        ),
    ] = None,
    sample: Annotated[
        int, typer.Option(metavar="K", min=0, help="The environment whose times to cross are drawn, counted from 0.")
    ] = 0,
    replay: Annotated[
        bool, typer.Option("--replay/--no-replay", help="Simulate the runs again, to be watched on the page.")
    ] = True,
    beside: Annotated[str | None, typer.Option("--beside", hidden=True)] = None,
    as_json: Json = False,
) -> None:
    """Draw a report of a study, or of trials alone.

    Prints its summary. DIR/index.html is the page, one file that needs no network; each figure stands beside it as SVG,
    PNG and PDF. The page replays runs, which the same build of carsim simulates again; each must end as the stored one.

    With --live nothing is written: the page shows what the store has while a sweep, a search or trials go on.

    \b
    Example: foldcar report study.db -o report --threshold 0.6 --threshold 0.8
             foldcar report study.db --live
    """
    from foldcar.report.figure_options import figure_options
    from foldcar.store.opening import require_store

    if live == (output is not None):
        raise FoldcarError("-o: --live serves the page and writes none" if live else "-o DIR is missing (or --live)")
    if port is not None and not live:
        raise FoldcarError("--port: only --live serves the page")
    if live and sample:
        raise FoldcarError("--sample: chooses the environment of a figure, and --live draws no figures")
    where = ["--live"] if output is None else ["-o", str(output)]
    command = ["foldcar", "report", str(store), *where]
    if simulated_trials:
        command.append("--simulated-trials")
    options = figure_options(threshold or [], sample)
    command += [word for share in options.chosen for word in ("--threshold", f"{share:g}")]
    if output is None:
        if beside is None:
            require_store(store)
        make = partial(_live_study, store, command, options, simulated_trials, beside in (LOG, LAN))
        serve(store, PORT if port is None else port, make, beside, as_json)
        return
    from foldcar.commands.progress_bar import TerminalBar
    from foldcar.report.replay import Replayer
    from foldcar.report.terminal import print_summary, summary_object
    from foldcar.report.write import PAGE, write_report
    from foldcar.store.reader import Store

    command += ["--sample", str(sample)] if sample else []
    if not replay:
        command.append("--no-replay")
    with Store.open(store) as opened, TerminalBar("replay", 0) as bar:
        replayer = Replayer(partial(_carsim, replay), usable_processors(), bar.plan, bar.done)
        data = write_report(opened, output, command, simulated_trials, replayer, options)
    if as_json:
        tell(True, {"store": store, "page": output / PAGE, "experiments": summary_object(data)})
        return
    print_summary(data)
    typer.echo(f"report: {output / PAGE}")


def _live_study(
    store: Path, command: list[str], options: "FigureOptions", simulated_trials: bool, taps: bool
) -> "LiveStudy":
    # Its imports take longer than to serve the page.
    from foldcar.report.live import LiveStudy

    return LiveStudy(store, command, options, simulated_trials, sys.stdout if taps else None)


def _carsim(replay: bool, engine: str) -> "Carsim | str":
    """The simulator with that engine, or why there is none: a report does not depend on it."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import engine_of
    from foldcar.simulation.runner import CarsimError

    if not replay:
        return "the report was made with --no-replay"
    try:
        return Carsim(engine=engine_of(engine))
    except CarsimError as error:
        return str(error)
