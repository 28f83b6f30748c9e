"""`foldcar check`: everything in a store, read and verified."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, print_json


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
    if as_json:
        print_json(
            {"store": store, "version": VERSION, "rows": done.rows, "logs": done.logs, "findings": findings}
        )
    else:
        for finding in findings:
            typer.echo(f"{store}: {finding}")
        found = f"{len(findings)} damaged" if findings else "sound"
        typer.echo(f"{store}: {found}; {done.rows} rows, {done.logs} logs read; version {VERSION}")
    if done.findings:
        raise typer.Exit(1)
