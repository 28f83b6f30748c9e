"""`foldcar migrate`: a store of an older version, brought up to this one."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, print_json


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
    if as_json:
        print_json({"store": store, "version": VERSION})
    else:
        typer.echo(f"{store}: version {VERSION}")
