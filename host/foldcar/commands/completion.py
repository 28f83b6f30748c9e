"""Completion of the command line by the shell: `eval "$(foldcar --completion bash)"`.

The shell calls `foldcar` with the variable _FOLDCAR_COMPLETE set, and gets the words that fit.
"""

import os
from typing import Annotated, Literal

import typer

VARIABLE = "_FOLDCAR_COMPLETE"


def _print_script(shell: str | None) -> None:
    if shell is None:
        return
    from typer._completion_shared import get_completion_script

    typer.echo(get_completion_script(prog_name="foldcar", complete_var=VARIABLE, shell=shell))
    raise typer.Exit


Completion = Annotated[
    Literal["bash", "zsh", "fish"] | None,
    typer.Option(
        "--completion",
        metavar="SHELL",
        callback=_print_script,
        is_eager=True,
        help='Print the completion for bash, zsh or fish, as in eval "$(foldcar --completion bash)".',
    ),
]


def enable_completion() -> None:
    """Make the shells known to typer, if one of them asks for completions."""
    if VARIABLE in os.environ:
        from typer._completion_classes import completion_init

        completion_init()
