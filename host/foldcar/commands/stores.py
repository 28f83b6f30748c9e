"""The commands for whole stores: `foldcar check`, `merge` and `export`."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import (
    STANDARD_OUTPUT,
    NewStore,
    SimulatedTrials,
    StudyStore,
    check_distinct,
    counts_text,
    output_file,
    print_lines,
    print_note,
)
from foldcar.errors import FoldcarError
from foldcar.statistics.words import count


def check(store: Annotated[Path, typer.Argument(metavar="STORE", help="Store to check.")]) -> None:
    """Check a store for damage.

    It checks SQLite's structures, references between rows and the logs of trials. Exit code 1 if anything is damaged.

    \b
    Example: foldcar check study.db
    """
    from foldcar.store.check import check_store
    from foldcar.store.tables import VERSION

    checked = check_store(store)
    findings = [" ".join(finding.split()) for finding in checked.findings]
    state = f"{len(findings)} damaged" if findings else "sound"
    lines = [*findings, f"{state}; {count(checked.rows, 'row')}, {count(checked.logs, 'log')} read; version {VERSION}"]
    print_lines(*(f"{store}: {line}" for line in lines))
    if findings:
        raise typer.Exit(1)


def merge(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Stores to merge, two or more.")],
    output: NewStore,
) -> None:
    """Merge several stores into a new one.

    The new store has all runs, scenes, experiments, and trials with their logs, without duplicates. It has
    the listing of the first store. Nothing is written if two stores have different results of the same run, different
    experiments with the same name, or different data of the same trial.

    \b
    Example: foldcar merge monday.db tuesday.db -o study.db
    """
    from foldcar.store.check import damaged_logs
    from foldcar.store.merge import merge_stores

    if len(stores) < 2:
        raise FoldcarError("merge: name two stores or more")
    check_distinct(stores, [output])
    row_counts = merge_stores(stores, output)
    for damage in damaged_logs(output):
        print_note(f"{output}: {damage}")
    shown_counts = {table: row_counts[table] for table in ("run", "experiment", "trial")}
    print_lines(f"{output}: {counts_text(shown_counts)}")


def export(
    store: StudyStore,
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="CSV file for the runs; -: standard output."),
    ] = None,
    parquet: Annotated[
        Path | None, typer.Option(metavar="FILE", callback=output_file, help="Parquet file for the runs.")
    ] = None,
    trials: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="CSV or .parquet file for the trials of built cars."),
    ] = None,
    simulated_trials: SimulatedTrials = False,
    failed: Annotated[
        bool, typer.Option("--failed", help="Write only failed runs, with their messages, to --csv and --parquet.")
    ] = False,
    digest: Annotated[
        bool, typer.Option("--digest", help="Print a digest of all runs' keys and results; their order does not matter.")
    ] = False,
) -> None:
    """Write a store's runs or trials as a table.

    Each row is a run with its outcome, metrics, design parameters and recorded values. The names of metrics contain
    their units. `passed` is empty if the environment does not define success.

    \b
    Example: foldcar export study.db --csv study.csv
    """
    from foldcar.report.export import export_csv, export_parquet, export_trials, write_csv
    from foldcar.shown_text import data_output
    from foldcar.store.check import store_digest
    from foldcar.store.reader import Store

    if not (csv or parquet or trials or digest):
        options_text = "--csv FILE, --parquet FILE, --trials FILE or --digest"
        raise FoldcarError(f"export: nothing to write; use {options_text}")
    check_distinct([store], [csv, parquet, trials])
    if digest and csv == STANDARD_OUTPUT:
        raise FoldcarError("export: --csv - and --digest both print on standard output; choose one")
    if failed and csv is None and parquet is None:
        raise FoldcarError("export: --failed: has no effect without --csv FILE or --parquet FILE")
    messages = []
    with Store.open(store) as reader:
        if csv == STANDARD_OUTPUT:
            write_csv(reader, data_output(), failed)
        elif csv is not None:
            messages.append(f"{csv}: {count(export_csv(reader, csv, failed), 'run')}")
        if parquet is not None:
            messages.append(f"{parquet}: {count(export_parquet(reader, parquet, failed), 'run')}")
        if trials is not None:
            number, left_out = export_trials(reader, trials, simulated_trials)
            messages.append(f"{trials}: {count(number, 'trial')}")
            if left_out:
                messages.append(f"{trials}: {left_out}")
        if digest:
            digest_text, runs = store_digest(reader)
            print_lines(f"{digest_text}  {count(runs, 'run')}")
    for message in messages:
        typer.echo(message, err=True)
