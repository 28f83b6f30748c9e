"""Commands on whole stores: `foldcar check`, `merge` and `export`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from foldcar.commands.options import (
    STANDARD_OUTPUT,
    Json,
    NewStore,
    SimulatedTrials,
    StudyStore,
    check_distinct,
    counts_text,
    output_file,
    print_result,
)
from foldcar.errors import FoldcarError


def check(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store to read.")], as_json: Json = False
) -> None:
    """Check a whole store: SQLite's structures, references between rows, the logs of trials.

    Exit code 1 if anything is damaged.

    \b
    Example: foldcar check study.db
    """
    from foldcar.store.check import check_store
    from foldcar.store.tables import VERSION

    done = check_store(store)
    findings = [" ".join(finding.split()) for finding in done.findings]
    state = f"{len(findings)} damaged" if findings else "sound"
    result = {"store": store, "version": VERSION, "rows": done.rows, "logs": done.logs, "findings": findings}
    lines = [*findings, f"{state}; {done.rows} rows, {done.logs} logs read; version {VERSION}"]
    print_result(as_json, result, *(f"{store}: {line}" for line in lines))
    if findings:
        raise typer.Exit(1)


def merge(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Two stores or more.")],
    output: NewStore,
    as_json: Json = False,
) -> None:
    """Make one store of several.

    Runs, scenes, experiments, trials with their logs, calibrations; what two stores have is there once. Refused, with
    nothing written, if a run has two results, an experiment's name stands for two, or two stores say different things of
    a trial. The listing is the first store's.

    \b
    Example: foldcar merge monday.db tuesday.db -o study.db
    """
    from foldcar.store.merge import merge_stores

    if len(stores) < 2:
        raise FoldcarError("merge: name two stores or more")
    check_distinct(stores, [output])
    rows = merge_stores(stores, output)
    counts = {f"{table}s": rows[table] for table in ("run", "experiment", "trial")}
    print_result(as_json, {"store": output, **counts}, f"{output}: {counts_text(counts)}")


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
    failed: Annotated[
        bool, typer.Option("--failed", help="In --csv and --parquet only the runs that failed, each with its message.")
    ] = False,
    digest: Annotated[
        bool, typer.Option("--digest", help="Print a digest of all runs' keys and results, whatever their order.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Write a store's runs or trials as a table.

    A row a run: outcome, metrics with their units in the columns' names, design parameters, recorded values; `passed` is
    empty where the environment does not define success.

    \b
    Example: foldcar export study.db --csv study.csv
    """
    from foldcar.report.export import export_csv, export_parquet, export_trials, write_csv
    from foldcar.shown_text import data_output
    from foldcar.store.check import store_digest
    from foldcar.store.reader import Store

    if not (csv or parquet or trials or digest):
        what = "--csv FILE, --parquet FILE, --trials FILE or --digest"
        raise FoldcarError(f"export: say what to write: {what}")
    check_distinct([store], [csv, parquet, trials])
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
        if digest:
            told = dict(zip(("digest", "runs"), store_digest(opened), strict=True))
    print_result(
        as_json,
        {"store": store, "written": written, **told},
        *([f"{told['digest']}  {told['runs']} runs"] if digest else []),
    )
    for one in () if as_json else written:
        counts = {what: count for what, count in one.items() if what not in ("path", "left_out")}
        typer.echo(f"{one['path']}: {counts_text(counts)}", err=True)
    for message in messages:
        typer.echo(message, err=True)
