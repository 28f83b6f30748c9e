"""The options and arguments that commands share, what their values mean, and how results are printed."""

import contextlib
import json
import math
import re
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.outputs import check_output_file, check_output_folder, check_replaceable
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_JOBS, MAX_SEED, checked_threshold
from foldcar.typed import decimal_number, did_you_mean

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.chunks import Simulators

STANDARD_OUTPUT = Path("-")

Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object, and nothing else.")]


def print_result(as_json: bool, result: Mapping[str, Any], *lines: object) -> None:
    """Print the object in ASCII, or else the lines; paths become texts, a number that is none (NaN, infinite) null."""
    if as_json:
        typer.echo(json.dumps(_plain(result), indent=2, allow_nan=False))
    else:
        for line in lines:
            typer.echo(line)


def print_note(text: str) -> None:
    """Print a note on standard error."""
    typer.echo(f"note: {text}", err=True)


def counts_text(counts: Mapping[str, int]) -> str:
    """``12 runs, 3 trials``."""
    return ", ".join(f"{count} {what}" for what, count in counts.items())


def command_line() -> str:
    """The command as it was typed."""
    return shlex.join(["foldcar", *sys.argv[1:]])


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def _checked(check: Callable[[Any], object]) -> Callable[[typer.Context, Any], Any]:
    """A callback of an option that calls ``check`` with a value, but neither without one nor for completions."""

    def callback(context: typer.Context, value: Any) -> Any:
        if value is not None and not context.resilient_parsing:
            check(value)
        return value

    return callback


def _check_file(file: Path) -> None:
    if file != STANDARD_OUTPUT:
        check_output_file(file)
        check_replaceable(file)


def _check_picture(file: Path) -> None:
    from foldcar.figures.output import check_format

    _check_file(file)
    check_format(file)


def _check_store(store: Path) -> None:
    from foldcar.store.connection import check_name

    check_name(store)
    check_output_file(store)


def _check_engine(engine: str) -> None:
    from foldcar.simulation.engines import ENGINES, TOLD

    if engine not in ENGINES:
        raise typer.BadParameter(f'"{engine}" is none of {", ".join(TOLD)}{did_you_mean(engine, TOLD)}')


def _check_thresholds(shares: float | Sequence[float]) -> None:
    for share in shares if isinstance(shares, Sequence) else [shares]:
        try:
            checked_threshold(share)
        except ValueError as error:
            raise FoldcarError(f"--threshold: {error}") from None


def _load(files: Sequence[Path]) -> None:
    """Register the modules before the command reads its listing."""
    if files:
        from foldcar.car.user_modules import load_components

        for file in files:
            load_components(file)


# FoldcarError if the value, a file or ``-``, a store, or a folder, cannot be written.
output_file, output_store, output_folder = _checked(_check_file), _checked(_check_store), _checked(check_output_folder)
thresholds_of_success = _checked(_check_thresholds)

Listing = Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing or design (JSON).")]
StudyStore = Annotated[Path, typer.Argument(metavar="STORE", help="Store of a sweep, and of trials if there are any.")]
TrialStore = Annotated[Path, typer.Argument(metavar="STORE", help="The store that holds the trials.")]
TrialNumber = Annotated[int, typer.Argument(metavar="TRIAL", min=1, help="Number of a trial, as `trials list` shows it.")]
OutputStore = Annotated[
    Path, typer.Option("--store", metavar="FILE", callback=output_store, help="Store to write; made if it is missing.")
]
NewStore = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="FILE", callback=output_store, help="Store to make; there must be none."),
]
OutputFolder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the files.")
]
Picture = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", callback=_checked(_check_picture), help="Picture (.png, .svg, .pdf)."),
]
CsvFile = Annotated[
    Path | None, typer.Option("--csv", metavar="FILE", callback=output_file, help="CSV file to write: a row a design.")
]
ExperimentId = Annotated[str, typer.Option("--experiment", metavar="ID", help="Experiment of the listing.")]
OneExperiment = Annotated[str | None, typer.Option("--experiment", metavar="ID", help="Only this experiment.")]
Vehicle = Annotated[
    str | None, typer.Option("--vehicle", metavar="ID", help="Vehicle of the listing, if it has several.")
]
Sample = Annotated[
    int,
    typer.Option(metavar="K", min=0, max=MAX_ENVIRONMENTS - 1, help="Number of the sampled environment and built car."),
]
Environments = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=MAX_ENVIRONMENTS, help="Sampled environments, instead of the listing's number."),
]
Seed = Annotated[int, typer.Option(metavar="S", min=0, max=MAX_SEED, help="Of all that is random.")]
Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=MAX_JOBS, help="Simulators in parallel; default: one per processor."),
]
Engine = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_checked(_check_engine),
        help="side-view (Box2D: quick, the same ground under both tracks), multibody (six degrees of freedom), or mujoco "
        "(slow, `make mujoco` builds it).",
    ),
]
Components = Annotated[
    list[Path] | None,
    typer.Option(
        "--components",
        metavar="FILE",
        callback=_checked(_load),
        help="Python file with modules of your own for type strings.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Simulate at the workers of a Dask scheduler, as tcp://10.0.0.1:8786; local:4 starts 4 workers here.",
    ),
]
UnderCalibration = Annotated[
    str | None,
    typer.Option(
        "--calibration", metavar="NAME", help="Simulate under this calibration of the store (see `foldcar calibrate`)."
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=MM", help="Choose a parameter or a part, e.g. width=95, W.length=60, tyre=none."),
]
Machine = Annotated[
    str, typer.Option(metavar="NAME", help="silhouette, cricut, laser or scissors: presets for the sheets.")
]
Sheet = Annotated[str | None, typer.Option(metavar="SIZE", help="a4, letter, a3, 12in, 12x24in or WIDTHxHEIGHT in mm.")]
Port = Annotated[
    str | None, typer.Option(metavar="PORT", help="Serial port, pseudo-terminal or tcp:HOST:PORT; default: detected.")
]
SimulatedTrials = Annotated[
    bool, typer.Option("--simulated-trials", help="Also trials of simulated cars, marked as such and counted apart.")
]
SimulatedTrialsInstead = Annotated[
    bool, typer.Option("--simulated-trials", help="Go by the trials of simulated cars instead of built ones.")
]


def check_scheduler_option(scheduler: str | None, jobs: int | None) -> None:
    """FoldcarError if the option's value is none, or stands beside ``--jobs``."""
    if scheduler is not None:
        from foldcar.study.cluster.simulators import check_scheduler

        check_scheduler(scheduler, jobs)


@contextlib.contextmanager
def simulators(
    scheduler: str | None, jobs: int | None, carsim: "Carsim", say: Callable[[str], None]
) -> "Iterator[Simulators | int]":
    """Where the command simulates: at the scheduler's workers, or in ``jobs`` simulators here. FoldcarError."""
    if scheduler is None:
        yield jobs or usable_processors()
        return
    from foldcar.study.cluster.simulators import open_cluster

    with open_cluster(scheduler, carsim, say) as cluster:
        yield cluster


def check_distinct(inputs: Sequence[Path], outputs: Sequence[Path | None]) -> None:
    """FoldcarError if an output would replace a file that the command reads, or another of its outputs."""
    taken = {file.resolve(): "is read by this command" for file in inputs}
    for output in outputs:
        if output is None or output == STANDARD_OUTPUT:
            continue
        if output.resolve() in taken:
            raise FoldcarError(f"{output}: {taken[output.resolve()]}; name another file to write")
        taken[output.resolve()] = "is named twice"


def design_settings(words: Sequence[str] | None) -> dict[str, float | str]:
    """Parse NAME=MM words to values (mm or degrees) by parameter or names of parts by kind; FoldcarError."""
    from foldcar.car.parts.catalogue import OPTIONS

    settings: dict[str, float | str] = {}
    for word in words or ():
        key, equals, text = word.partition("=")
        if key in settings:
            first = settings[key]
            shown = first if isinstance(first, str) else f"{first:g}"
            raise FoldcarError(f"--set {word}: {key} is given twice, first as {shown}")
        if equals and key in OPTIONS:
            settings[key] = text
            continue
        try:
            settings[key] = {"true": 1.0, "false": 0.0}[text] if text in ("true", "false") else decimal_number(text)
        except ValueError:
            equals = ""
        if not equals:
            raise FoldcarError(f"--set {word}: not NAME=MM, as in --set width=95, nor a part, as in --set tyre=none")
    return settings


def parse_points(option: str, text: str, least: float = 1.0, most: float = 50.0) -> float:
    """``15pp`` as a share, 0.15; FoldcarError, naming the option, if it is not within ``least`` to ``most`` points."""
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*pp\s*", text)
    if found is None:
        raise FoldcarError(f'{option}: "{text}" is not a number of percentage points, as 15pp')
    value = float(found[1])
    if not least <= value <= most:
        raise FoldcarError(f"{option}: {text.strip()} is not within {least:g}pp to {most:g}pp")
    return value / 100
