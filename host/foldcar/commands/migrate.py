"""`foldcar migrate`: a store of an older version, brought up to this one."""

from pathlib import Path
from typing import Annotated

import typer


def migrate(store: Annotated[Path, typer.Argument(metavar="STORE", help="The store to migrate.")]) -> None:
    """Bring a store up to this version, in place; a copy as it was stays beside it. Writing commands do it too."""
    from foldcar.store.migrations import VERSION
    from foldcar.store.opening import require_store, writing

    require_store(store)
    with writing(store):
        typer.echo(f"{store}: version {VERSION}")
