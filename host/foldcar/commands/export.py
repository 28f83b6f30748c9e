"""`foldcar export`: a store's runs as CSV or Parquet, or all of it as a folder."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from foldcar.commands.options import (
    STANDARD_OUTPUT,
    Json,
    SimulatedTrials,
    StudyStore,
    check_distinct,
    counts_text,
    output_file,
    output_folder,
    tell,
)
from foldcar.errors import FoldcarError


def export(
    store: StudyStore,
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="CSV file to write; - for standard output."),
    ] = None,
    parquet: Annotated[
        Path | None, typer.Option(metavar="FILE", callback=output_file, help="Parquet file to write.")
    ] = None,
    trials: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="CSV or .parquet file for the trials of built cars."),
    ] = None,
    simulated_trials: SimulatedTrials = False,
    folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", callback=output_folder, help="Folder to write the whole store to, logs of trials included."
        ),
    ] = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="In --csv and --parquet only the runs that failed, each with its message.")
    ] = False,
    table_format: Annotated[
        Literal["csv", "parquet"],
        typer.Option("--format", metavar="FORMAT", help="Of the folder's tables: csv or parquet."),
    ] = "csv",
    digest: Annotated[
        bool, typer.Option("--digest", help="Print a digest of all runs' keys and results, whatever their order.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Write a store's runs as a table, or all of it.

    A row a run: outcome, metrics with their units in the columns' names, design parameters, recorded values; `passed` is
    empty where the environment does not define success. With --folder all of the store, so that nothing needs foldcar
    and `foldcar import` makes it again.

    \b
    Example: foldcar export study.db --csv study.csv
    """
    from foldcar.report.export import export_csv, export_parquet, export_trials, write_csv
    from foldcar.shown_text import data_output
    from foldcar.store.check import store_digest
    from foldcar.store.folder import export_folder
    from foldcar.store.reader import Store

    if not (csv or parquet or trials or folder or digest):
        what = "--csv FILE, --parquet FILE, --trials FILE, --folder DIR or --digest"
        raise FoldcarError(f"export: say what to write: {what}")
    check_distinct([store], [csv, parquet, trials, folder])
    for option, given in (("--json", as_json), ("--digest", digest)):
        if given and csv == STANDARD_OUTPUT:
            raise FoldcarError(f"export: --csv - and {option} both print on standard output; choose one")
    if failed and csv is None and parquet is None:
        raise FoldcarError("export: --failed: says nothing without --csv FILE or --parquet FILE")
    told: dict[str, Any] = {}
    written: list[dict[str, Any]] = []
    messages = []
    with Store.open(store) as opened:
        if csv == STANDARD_OUTPUT:
            write_csv(opened, data_output(), failed)
        elif csv is not None:
            written.append({"path": csv, "runs": export_csv(opened, csv, failed)})
        if parquet is not None:
            written.append({"path": parquet, "runs": export_parquet(opened, parquet, failed)})
        if trials is not None:
            count, left_out = export_trials(opened, trials, simulated_trials)
            written.append({"path": trials, "trials": count, "left_out": left_out})
            messages += [f"{trials}: {left_out}"] if left_out else []
        if folder is not None:
            manifest = export_folder(opened, folder, table_format)
            gone = [log for log, digest in manifest.logs.items() if digest is None]
            messages += [f"{store}: log {log} is gone" for log in gone]
            rows, logs = manifest.rows, len(manifest.logs) - len(gone)
            written.append({"path": folder, "runs": rows["run"], "trials": rows["trial"], "logs": logs})
        if digest:
            told = dict(zip(("digest", "runs"), store_digest(opened), strict=True))
    tell(
        as_json,
        {"store": store, "written": written, **told},
        *([f"{told['digest']}  {told['runs']} runs"] if digest else []),
    )
    for one in () if as_json else written:
        counts = {what: count for what, count in one.items() if what not in ("path", "left_out")}
        typer.echo(f"{one['path']}: {counts_text(counts)}", err=True)
    for message in messages:
        typer.echo(message, err=True)
