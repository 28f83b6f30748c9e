"""The command `foldcar` with its subcommands; errors are printed as one line on stderr.

Exit codes: 0 done; 1 runs failed, or broken pipe; 2 an error of input or environment; 130 stopped by Ctrl-C, SIGTERM or
a closed terminal. To print help quickly, a command's module is imported when the command is called; it imports slow
libraries in its functions.
"""

import atexit
import gc
import os
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any, Literal, NoReturn

import typer
from typer.core import TyperGroup

from foldcar.errors import FoldcarError
from foldcar.installation import keep_caches_in_checkout, missing_extra
from foldcar.interrupts import EXIT_CODE, handle_signals, stop_line
from foldcar.shown_text import show_text
from foldcar.version import __version__

# The environment variable by which a shell asks for completions.
VARIABLE = "_FOLDCAR_COMPLETE"


def _print_script(shell: str | None) -> None:
    """Print the completion script for ``shell`` and exit; without a shell do nothing."""
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
        help='Print the completion script for a shell; use it as eval "$(foldcar --completion bash)".',
    ),
]


def enable_completion() -> None:
    """Register the shells with typer if a shell asks for completions."""
    if VARIABLE in os.environ:
        from typer._completion_classes import completion_init

        completion_init()


# Number of new objects after which Python collects garbage.
GARBAGE_THRESHOLD = 50_000

# The commands in the order of `foldcar -h`, and the modules of foldcar.commands that they are in.
COMMANDS = {
    "new": "new", "sweep": "sweep", "optimize": "optimize", "run": "run", "sample": "sample",
    "report": "report", "select": "advice", "compare": "advice", "export": "stores",
    "check": "stores", "merge": "stores", "model": "model", "pattern": "pattern", "view": "view", "link": "link",
    "log": "log", "flash": "flash", "doctor": "doctor",
    "calibrate-servos": "params", "trials": "trials", "params": "params",
}  # fmt: skip


class _CommandsOnDemand(Mapping[str, Any]):
    """The commands by name; a module is imported when its command is looked up."""

    def __len__(self) -> int:
        return len(COMMANDS)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __getitem__(self, name: str) -> Any:
        """Import the module of a command and return the command, or the group if it has subcommands."""
        module = import_module(f"foldcar.commands.{COMMANDS[name]}")
        command = getattr(module, name.replace("-", "_"))
        if isinstance(command, typer.Typer):
            return typer.main.get_group(command)
        app_of_command = typer.Typer(add_completion=False, rich_markup_mode=None)
        app_of_command.command(name)(command)
        return typer.main.get_command(app_of_command)


class _Commands(TyperGroup):
    """The group of all commands."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**{**options, "commands": _CommandsOnDemand()})


app = typer.Typer(
    name="foldcar",
    cls=_Commands,
    help="Design folding robot cars, simulate them in sampled environments, and choose which to build.",
    no_args_is_help=True,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _print_version(requested: bool) -> None:
    if requested:
        typer.echo(f"foldcar {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit."),
    ] = False,
    completion: Completion = None,
) -> None:
    """Design folding robot cars, simulate them in sampled environments, and choose which to build."""


def main() -> None:
    """Run the command line and exit."""
    # Control characters of printed texts are escaped, because texts may come from files and cars.
    show_text()
    handle_signals()
    enable_completion()
    keep_caches_in_checkout()
    _limit_garbage_collection()
    # The matrices are small: starting threads for them takes longer than it saves, and slows the simulators.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    atexit.register(_silence_broken_pipe)
    try:
        app()
    except BaseException as error:
        message, code = _ending(error)
        if message is None:
            raise
        sys.stderr.write(f"{message}\n")
        if code == EXIT_CODE:
            _exit_after_interrupt()
        sys.exit(code)


def _limit_garbage_collection() -> None:
    """Let Python collect garbage seldom, and not at its end.

    Most objects live until the command ends, so collecting garbage is seldom worth its time. At Python's default rate it
    takes a tenth of the time of `foldcar pattern`.
    """
    gc.set_threshold(GARBAGE_THRESHOLD)
    atexit.register(gc.freeze)


def _exit_after_interrupt() -> NoReturn:
    """End the process with the exit code of an interrupted command, after the functions that were registered for its end.

    Python itself ends a process by the signal SIGINT, without this exit code, if a KeyboardInterrupt came while `exec`
    was running. The module dataclasses uses `exec`.
    """
    atexit._run_exitfuncs()
    os._exit(EXIT_CODE)


def _ending(error: BaseException) -> tuple[str | None, int]:
    """Return the message and the exit code with which an error ends the command.

    The message is None if the error is a bug in foldcar.
    """
    line = stop_line()
    if line is not None:
        # A signal has stopped the command. The error is its consequence.
        return line, EXIT_CODE
    if isinstance(error, FoldcarError):
        return "foldcar: error: " + "\n".join(error.lines()), error.exit_code
    if isinstance(error, ModuleNotFoundError):
        remedy = missing_extra(error)
        if remedy is None:
            # The module belongs to no extra, so this is a bug.
            return None, 2
        return f"foldcar: error: {remedy}", 2
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename is not None else ""
        return "foldcar: error: " + " ".join(f"{where}{error.strerror or error}".split()), 2
    return None, 1


def _silence_broken_pipe() -> None:
    """After a broken pipe, discard buffered output: Python 3.13 would write it again at exit and print an error."""
    for stream in filter(None, (sys.__stdout__, sys.__stderr__)):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
