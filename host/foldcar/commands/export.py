"""`foldcar export`: a store's runs as CSV or Parquet."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from foldcar.errors import FoldcarError


def export(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store that a sweep wrote.")],
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CSV file to write; - for standard output.")
    ] = None,
    parquet: Annotated[Path | None, typer.Option(metavar="FILE", help="Parquet file to write.")] = None,
    trials: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CSV file to write the trials of built cars to.")
    ] = None,
) -> None:
    """Write every run of a store as a row: outcome, measures, design parameters, recorded values."""
    from foldcar.report.export import export_csv, export_parquet, write_csv
    from foldcar.report.export_trials import export_trials
    from foldcar.store.reader import Store

    if csv is None and parquet is None and trials is None:
        raise FoldcarError("export: say what to write: --csv FILE, --parquet FILE or --trials FILE")
    with Store.open(store) as opened:
        if csv is not None and str(csv) == "-":
            write_csv(opened, sys.stdout)
        elif csv is not None:
            typer.echo(f"{csv}: {export_csv(opened, csv)} runs", err=True)
        if parquet is not None:
            typer.echo(f"{parquet}: {export_parquet(opened, parquet)} runs", err=True)
        if trials is not None:
            typer.echo(f"{trials}: {export_trials(opened, trials)} trials", err=True)
