"""Options that name outputs: a path that cannot be written is refused before any work is done for it."""

from collections.abc import Sequence
from pathlib import Path

import typer

from foldcar.errors import FoldcarError
from foldcar.output_folder import check_output_file, check_output_folder, check_replaceable

STANDARD_OUTPUT = Path("-")


def output_file(context: typer.Context, file: Path | None) -> Path | None:
    """The option's value, a file or ``-``; FoldcarError if it cannot be written, or is a store."""
    if file is not None and file != STANDARD_OUTPUT and not context.resilient_parsing:
        check_output_file(file)
        check_replaceable(file)
    return file


def output_store(context: typer.Context, store: Path | None) -> Path | None:
    """The option's value, a store that is written or made; FoldcarError if it cannot be."""
    if store is not None and not context.resilient_parsing:
        from foldcar.store.errors import check_name

        check_name(store)
        check_output_file(store)
    return store


def output_folder(context: typer.Context, folder: Path | None) -> Path | None:
    """The option's value, a folder; FoldcarError if it cannot be written."""
    if folder is not None and not context.resilient_parsing:
        check_output_folder(folder)
    return folder


def check_distinct(inputs: Sequence[Path], outputs: Sequence[Path | None]) -> None:
    """FoldcarError if an output would replace a file that the command reads, or another of its outputs."""
    taken = {file.resolve(): "is read by this command" for file in inputs}
    for output in outputs:
        if output is None or output == STANDARD_OUTPUT:
            continue
        if output.resolve() in taken:
            raise FoldcarError(f"{output}: {taken[output.resolve()]}; name another file to write")
        taken[output.resolve()] = "is named twice"
