"""`foldcar migrate`: a store of an older version, brought up to this one."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, print_json


def migrate(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="The store to migrate.")], as_json: Json = False
) -> None:
    """Bring an older store up to this version.

    The store is changed in place; a copy as it was stays beside it. Commands that write do it too.

    \b
    Example: foldcar migrate study.db
    """
    from foldcar.store.migrations import VERSION
    from foldcar.store.opening import require_store, undo_half_done, writing

    undo_half_done(store)
    require_store(store)
    with writing(store):
        pass
    if as_json:
        print_json({"store": store, "version": VERSION})
    else:
        typer.echo(f"{store}: version {VERSION}")
