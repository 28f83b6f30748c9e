"""`--components FILE`: user modules, for every command that reads designs."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer


def _load(context: typer.Context, files: Sequence[Path] | None) -> Sequence[Path] | None:
    """Register the modules before the command reads its listing."""
    if files and not context.resilient_parsing:
        from foldcar.car.modules import load_components

        for file in files:
            load_components(file)
    return files


Components = Annotated[
    list[Path] | None,
    typer.Option(
        "--components", metavar="FILE", callback=_load, help="Python file with modules of your own for type strings."
    ),
]
