"""Options that name outputs: a path that cannot be written is refused before any work is done for it."""

from pathlib import Path

import typer

from foldcar.output_folder import check_output_file, check_output_folder

STANDARD_OUTPUT = Path("-")


def output_file(context: typer.Context, file: Path | None) -> Path | None:
    """The option's value, a file or ``-``; FoldcarError if it cannot be written."""
    if file is not None and file != STANDARD_OUTPUT and not context.resilient_parsing:
        check_output_file(file)
    return file


def output_folder(context: typer.Context, folder: Path | None) -> Path | None:
    """The option's value, a folder; FoldcarError if it cannot be written."""
    if folder is not None and not context.resilient_parsing:
        check_output_folder(folder)
    return folder
