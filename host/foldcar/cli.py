"""The command `foldcar`: its subcommands, and errors as one line on stderr.

Exit codes: 0 done, 1 runs failed, or the reader of the output closed it, 2 an error of input or environment,
130 stopped by Ctrl-C, SIGTERM or a closed terminal.
Slow imports are made inside the commands, so that help is printed at once.
"""

import atexit
import gc
import os
import re
import sys
from typing import Annotated, Literal

import typer

from foldcar import __version__
from foldcar.commands.advice import compare, select
from foldcar.commands.calibrate import calibrate
from foldcar.commands.doctor import doctor
from foldcar.commands.flash import flash
from foldcar.commands.link import link
from foldcar.commands.log import log
from foldcar.commands.model import model
from foldcar.commands.new import new
from foldcar.commands.optimize import optimize
from foldcar.commands.params import calibrate_servos, params
from foldcar.commands.pattern import pattern
from foldcar.commands.report import report
from foldcar.commands.run import run
from foldcar.commands.sample import gallery, sample
from foldcar.commands.stores import check, export, merge
from foldcar.commands.sweep import sweep
from foldcar.commands.track import lens, markers, track
from foldcar.commands.trials import trials
from foldcar.commands.view import view
from foldcar.errors import FoldcarError
from foldcar.installation import missing_extra
from foldcar.interrupts import EXIT_CODE, listen, stop_line
from foldcar.shown_text import show_text

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


GARBAGE_THRESHOLD = 50_000
# More than any path on Linux below a few folders.
LONGEST_WORD = 300

app = typer.Typer(
    name="foldcar",
    help="Which folding cars to build: sample environments, simulate designs, report.",
    no_args_is_help=True,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    new, sweep, optimize, run, sample, gallery, report, select, compare, calibrate, export, check, merge,
    model, pattern, view, link, log, markers, lens, track, flash, doctor,
):  # fmt: skip
    app.command()(command)
app.command("calibrate-servos")(calibrate_servos)
app.add_typer(trials)
app.add_typer(params)


def _print_version(wanted: bool) -> None:
    if wanted:
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
    """Which folding cars to build: sample environments, simulate designs, report."""


def main() -> None:
    """Run the command line and exit."""
    show_text()
    listen()
    enable_completion()
    # Most objects live until the command ends; garbage collection at the default rate takes a tenth of the time of
    # `foldcar pattern`.
    gc.set_threshold(GARBAGE_THRESHOLD)
    # numpy's matrices are small here: threads for them would take longer to start than they save, and processors from
    # simulators.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # No collection when the process ends.
    atexit.register(gc.freeze)
    atexit.register(_drop_unread_output)
    try:
        try:
            app()
        except (Exception, SystemExit):
            # A signal has ended the command, or what it did when it came.
            if (line := stop_line()) is None:
                raise
            sys.exit(_print_error(line, EXIT_CODE))
    except FoldcarError as error:
        sys.exit(_print_error("foldcar: error: " + "\n".join(error.lines()), error.exit_code))
    except ModuleNotFoundError as error:
        remedy = missing_extra(error)
        if remedy is None:
            raise
        sys.exit(_print_error(f"foldcar: error: {remedy}", 2))
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        sys.exit(_print_error("foldcar: error: " + " ".join(f"{where}{error.strerror or error}".split()), 2))


def _drop_unread_output() -> None:
    """Drop what a closed pipe has not taken: Python 3.13 may write it again as it ends, and report that it cannot."""
    for stream in filter(None, (sys.__stdout__, sys.__stderr__)):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _print_error(message: str, code: int) -> int:
    # A file's longest words, such as numbers of 400 digits, are shortened.
    shown = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda word: f"{word[0][:40]}…{word[0][-10:]}", message)
    sys.stderr.write(f"{shown}\n")
    return code
