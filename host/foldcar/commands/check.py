"""`foldcar check`: everything in a store, read and verified."""

from pathlib import Path
from typing import Annotated

import typer


def check(store: Annotated[Path, typer.Argument(metavar="STORE", help="The store to read.")]) -> None:
    """Read a whole store and name what is damaged. Exit code 1 if anything is."""
    from foldcar.store.check import check_store
    from foldcar.store.migrations import VERSION

    done = check_store(store)
    for finding in done.findings:
        typer.echo(f"{store}: {' '.join(finding.split())}")
    version = f"version {done.version}"
    if done.version < VERSION:
        version += ", which has no checksums"
    found = f"{len(done.findings)} damaged" if done.findings else "sound"
    typer.echo(f"{store}: {found}; {done.rows} rows, {done.logs} logs read; {version}")
    if done.findings:
        raise typer.Exit(1)
