"""`foldcar export`: a store's runs as CSV or Parquet, or all of it as a folder."""

import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from foldcar.commands.simulated_trials_option import SimulatedTrials
from foldcar.errors import FoldcarError


def export(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store that a sweep wrote.")],
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CSV file to write; - for standard output.")
    ] = None,
    parquet: Annotated[Path | None, typer.Option(metavar="FILE", help="Parquet file to write.")] = None,
    trials: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CSV file to write trials of built cars to.")
    ] = None,
    simulated_trials: SimulatedTrials = False,
    folder: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder to write the whole store to, logs of trials included.")
    ] = None,
    table_format: Annotated[
        Literal["csv", "parquet"], typer.Option("--format", help="Of the tables in the folder.")
    ] = "csv",
) -> None:
    """Write every run of a store as a row: outcome, measures, design parameters, recorded values.

    With --folder write all of the store, so that nothing needs foldcar and `foldcar import` makes it again.
    """
    from foldcar.report.export import export_csv, export_parquet, write_csv
    from foldcar.report.export_trials import export_trials
    from foldcar.store.folder_export import export_folder
    from foldcar.store.reader import Store

    if csv is None and parquet is None and trials is None and folder is None:
        raise FoldcarError("export: say what to write: --csv FILE, --parquet FILE, --trials FILE or --folder DIR")
    with Store.open(store) as opened:
        if csv is not None and str(csv) == "-":
            write_csv(opened, sys.stdout)
        elif csv is not None:
            typer.echo(f"{csv}: {export_csv(opened, csv)} runs", err=True)
        if parquet is not None:
            typer.echo(f"{parquet}: {export_parquet(opened, parquet)} runs", err=True)
        if trials is not None:
            count, left_out = export_trials(opened, trials, simulated_trials)
            typer.echo(f"{trials}: {count} trials", err=True)
            if left_out is not None:
                typer.echo(f"{trials}: {left_out}", err=True)
        if folder is not None:
            manifest = export_folder(opened, folder, table_format)
            gone = [log for log, digest in manifest["logs"].items() if digest is None]
            for log in gone:
                typer.echo(f"{store}: log {log} is gone", err=True)
            rows, logs = manifest["rows"], len(manifest["logs"]) - len(gone)
            typer.echo(f"{folder}: {rows['run']} runs, {rows['trial']} trials, {logs} logs", err=True)
