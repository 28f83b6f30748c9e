"""`foldcar repair`: a new store of what is whole in a damaged one."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, output_store, print_json


def repair(
    store: Annotated[Path, typer.Argument(metavar="DAMAGED", help="The damaged store, which is only read.")],
    output: Annotated[
        Path,
        typer.Option("-o", metavar="WHOLE", callback=output_store, help="The store to make; there must be none."),
    ],
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
    if as_json:
        print_json({"store": output, **asdict(done)})
    else:
        for finding in done.findings:
            typer.echo(f"{store}: {finding}")
        for table, saved in done.saved.items():
            losses = ((done.missing, "missing"), (done.dependent, "refer to what is lost"))
            parts = [f"{lost[table]} {text}" for lost, text in losses if lost.get(table)]
            if parts:
                typer.echo(f"{table}: {saved} rows saved; lost: {', '.join(parts)}")
        for trial in done.trials:
            typer.echo(trial)
        for log in done.logs:
            typer.echo(f"{log}: its trial is lost; the log is kept")
        rows = sum(done.saved.values())
        typer.echo(f"{output}: {rows} rows saved, {done.saved['run']} of them runs, {done.saved['trial']} trials")
    if not done.is_whole:
        raise typer.Exit(1)
