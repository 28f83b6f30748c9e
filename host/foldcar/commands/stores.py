"""Commands on whole stores: `foldcar check`, `repair`, `migrate`, `merge` and `import`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, NewStore, check_distinct, counts_text, output_store, tell
from foldcar.errors import FoldcarError


def check(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store to read.")], as_json: Json = False
) -> None:
    """Read a whole store and name what is damaged.

    Exit code 1 if anything is. Nothing is changed.

    \b
    Example: foldcar check study.db
    """
    from foldcar.store.check import check_store
    from foldcar.store.migrations import VERSION

    done = check_store(store)
    findings = [" ".join(finding.split()) for finding in done.findings]
    state = f"{len(findings)} damaged" if findings else "sound"
    result = {"store": store, "version": VERSION, "rows": done.rows, "logs": done.logs, "findings": findings}
    lines = [*findings, f"{state}; {done.rows} rows, {done.logs} logs read; version {VERSION}"]
    tell(as_json, result, *(f"{store}: {line}" for line in lines))
    if findings:
        raise typer.Exit(1)


def repair(
    store: Annotated[Path, typer.Argument(metavar="DAMAGED", help="The damaged store, which is only read.")],
    output: NewStore,
    as_json: Json = False,
) -> None:
    """Save what is whole of a damaged store.

    It says what is lost. A row is saved if it matches its checksum. Runs that are lost are simulated by the next sweep
    into the new store. Exit code 1 if anything is lost.

    \b
    Example: foldcar repair study.db -o whole.db
    """
    from foldcar.store.repair import repair_store

    done = repair_store(store, output)
    lines = [f"{store}: {finding}" for finding in done.findings]
    for table, saved in done.saved.items():
        losses = {"missing": done.missing.get(table), "refer to what is lost": done.dependent.get(table)}
        parts = [f"{lost} {text}" for text, lost in losses.items() if lost]
        if parts:
            lines.append(f"{table}: {saved} rows saved; lost: {', '.join(parts)}")
    lines += [*done.trials, *(f"{log}: its trial is lost; the log is kept" for log in done.logs)]
    rows, runs, trials = sum(done.saved.values()), done.saved["run"], done.saved["trial"]
    lines.append(f"{output}: {rows} rows saved, {runs} of them runs, {trials} trials")
    tell(as_json, {"store": output, **asdict(done)}, *lines)
    if not done.is_whole:
        raise typer.Exit(1)


def migrate(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store to migrate.")], as_json: Json = False
) -> None:
    """Bring an older store up to this version.

    The store is changed in place; a copy as it was stays beside it. What a killed program left half done is undone.

    \b
    Example: foldcar migrate study.db
    """
    from foldcar.store.migrations import VERSION
    from foldcar.store.opening import migrate_store

    migrate_store(store)
    tell(as_json, {"store": store, "version": VERSION}, f"{store}: version {VERSION}")


def merge(
    stores: Annotated[list[Path], typer.Argument(metavar="STORE...", help="Two stores or more.")],
    output: NewStore,
    as_json: Json = False,
) -> None:
    """Make one store of several.

    Runs, scenes, experiments, trials with their logs, calibrations; what two of them have is there once. Refused, with
    nothing written, if a run has two results or an experiment's name stands for two. The listing is the first store's.

    \b
    Example: foldcar merge monday.db tuesday.db -o study.db
    """
    from foldcar.store.merge import merge_stores

    if len(stores) < 2:
        raise FoldcarError("merge: name two stores or more")
    check_distinct(stores, [output])
    rows = merge_stores(stores, output)
    counts = {f"{table}s": rows[table] for table in ("run", "experiment", "trial")}
    tell(as_json, {"store": output, **counts}, f"{output}: {counts_text(counts)}")


def import_store(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="What `foldcar export STORE --folder DIR` wrote, or a file of kept work."),
    ],
    store: Annotated[
        Path,
        typer.Option(
            metavar="FILE", callback=output_store, help="The store to make, which must not exist; of kept work its own."
        ),
    ],
    as_json: Json = False,
) -> None:
    """Make a store of an exported folder.

    The logs of its trials are copied beside it. After an error, nothing is written. Or take in what a command kept in a
    file, as it said, because its store could not be written.

    \b
    Example: foldcar import study --store again.db
    """
    from foldcar.store.folder import import_folder
    from foldcar.store.kept_work import take_in

    if folder.is_file():
        done = take_in(folder, store)
        tell(as_json, {"store": store, "taken_in": done}, f"{store}: {done}")
        return
    manifest = import_folder(folder, store)
    logs = sum(digest is not None for digest in manifest.logs.values())
    counts = {"runs": manifest.rows["run"], "trials": manifest.rows["trial"], "logs": logs}
    tell(as_json, {"store": store, **counts}, f"{store}: {counts_text(counts)}")
