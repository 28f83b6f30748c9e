"""The command `foldcar`: its subcommands, and errors as one line on stderr.

Exit codes: 0 done, 1 runs failed, or the reader of the output closed it, 2 an error of input or environment,
130 stopped by Ctrl-C, SIGTERM or a closed terminal.
Slow imports are made inside the commands, so that help is printed at once.
"""

import atexit
import contextlib
import gc
import inspect
import os
import re
import sys
from typing import Annotated, Any, Literal, get_args

import typer
from typer.core import TyperCommand

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
from foldcar.interrupts import listen
from foldcar.shown_text import show_text
from foldcar.typed import decimal_number, whole_number

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


class StrictCommand(TyperCommand):
    """A command whose options and arguments that are numbers have been typed as such.

    What turns the words of a command line into numbers takes underscores and, depending on its version, digits of other
    scripts.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse the first word that is no number; then parse all, as any command does."""
        if not ctx.resilient_parsing:
            typed = self.make_parser(ctx).parse_args(args=list(args))[0]
            for param in self.params:
                parse = _parser(self.callback, param.name)
                words = typed.get(param.name)
                for word in words if isinstance(words, list | tuple) else [words]:
                    if parse is not None and isinstance(word, str):
                        _check(parse, word, ctx, param)
        return super().parse_args(ctx, args)


def _parser(callback: Any, name: str | None) -> Any:
    """What reads the texts of that parameter of the command's function; None unless it is a number or numbers."""
    declared = inspect.signature(inspect.unwrap(callback)).parameters.get(name or "")
    kinds = _kinds(declared.annotation) if declared else set()
    return whole_number if int in kinds else decimal_number if float in kinds else None


def _kinds(annotation: Any) -> set[Any]:
    """The types that an annotation, as Annotated[list[int] | None, …], is made of."""
    parts = get_args(annotation)
    return {kind for part in parts for kind in _kinds(part)} if parts else {annotation}


def _check(parse: Any, word: str, ctx: Any, param: Any) -> None:
    try:
        parse(word)
    except ValueError:
        kind = "whole number" if parse is whole_number else "number"
        raise typer.BadParameter(f"{word!r} is no {kind}, as 12", ctx=ctx, param=param) from None


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
for group in (app, trials, params):
    for registered in group.registered_commands:
        registered.cls = StrictCommand


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
    atexit.register(_drop_what_nobody_reads)
    try:
        app()
    except FoldcarError as error:
        sys.exit(_fail("\n".join(error.lines()), error.exit_code))
    except ModuleNotFoundError as error:
        remedy = missing_extra(error)
        if remedy is None:
            raise
        sys.exit(_fail(remedy, 2))
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        sys.exit(_fail(" ".join(f"{where}{error.strerror or error}".split()), 2))


def _drop_what_nobody_reads() -> None:
    """What a closed pipe has not taken: Python 3.13 may write it once more as it ends, and report that it cannot."""
    for stream in (sys.__stdout__, sys.__stderr__):
        if stream is None or stream.closed:
            continue
        try:
            stream.flush()
        except OSError:
            with contextlib.suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _fail(message: str, code: int) -> int:
    # A file's longest words, such as numbers of 400 digits, are shortened.
    shown = re.sub(rf"\S{{{LONGEST_WORD + 1},}}", lambda word: f"{word[0][:40]}…{word[0][-10:]}", message)
    sys.stderr.write(f"foldcar: error: {shown}\n")
    return code
