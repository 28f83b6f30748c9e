"""Options and arguments that several commands share, checks of their values, and printing of results."""

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
from foldcar.statistics.words import count
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_JOBS, MAX_SEED, checked_threshold
from foldcar.typed import decimal_number, did_you_mean

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.chunks import Simulators

STANDARD_OUTPUT = Path("-")

Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]


def print_result(as_json: bool, result: Mapping[str, Any], *lines: object) -> None:
    """Print ``result`` as ASCII JSON if ``as_json``, else the ``lines``.

    In JSON, paths become strings; NaN and infinity become null.
    """
    if as_json:
        typer.echo(json.dumps(_plain(result), indent=2, allow_nan=False))
    else:
        print_lines(*lines)


def print_lines(*lines: object) -> None:
    """Print lines on standard output."""
    for line in lines:
        typer.echo(line)


def print_note(text: str) -> None:
    """Print a note on standard error."""
    typer.echo(f"note: {text}", err=True)


def counts_text(counts: Mapping[str, int]) -> str:
    """Return text such as ``12 runs, 1 trial``, for numbers by noun."""
    return ", ".join(count(number, noun) for noun, number in counts.items())


def command_line() -> str:
    """Return the command as the user typed it."""
    return shlex.join(["foldcar", *sys.argv[1:]])


def _plain(value: Any) -> Any:
    """Return a value in types that JSON has: paths as strings, infinite numbers and NaN as None."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def _checked(check: Callable[[Any], object]) -> Callable[[typer.Context, Any], Any]:
    """Return an option's callback that calls ``check`` with its value.

    ``check`` is not called if the option is not given, or while a shell completes the command line.
    """

    def callback(context: typer.Context, value: Any) -> Any:
        """Check the option's value, and return it unchanged."""
        if value is not None and not context.resilient_parsing:
            check(value)
        return value

    return callback


def _check_file(file: Path) -> None:
    """Raise FoldcarError if the file cannot be written; "-" stands for standard output."""
    if file != STANDARD_OUTPUT:
        check_output_file(file)
        check_replaceable(file)


def _check_picture(file: Path) -> None:
    """Raise FoldcarError if the picture cannot be written, or its format is unknown."""
    from foldcar.figures.output import check_format

    _check_file(file)
    check_format(file)


def _check_store(store: Path) -> None:
    """Raise FoldcarError if a store cannot be written under this name."""
    from foldcar.store.connection import check_name

    check_name(store)
    check_output_file(store)


def _check_engine(engine: str) -> None:
    """Raise BadParameter if there is no engine of this name."""
    from foldcar.simulation.engines import ENGINES, OFFERED

    if engine not in ENGINES:
        raise typer.BadParameter(f'"{engine}" is not one of {", ".join(OFFERED)}{did_you_mean(engine, OFFERED)}')


def _check_thresholds(thresholds: float | Sequence[float]) -> None:
    """Raise FoldcarError if a threshold is not between 0 and 1."""
    for threshold in thresholds if isinstance(thresholds, Sequence) else [thresholds]:
        try:
            checked_threshold(threshold)
        except ValueError as error:
            raise FoldcarError(f"--threshold: {error}") from None


def _load_modules(files: Sequence[Path]) -> None:
    """Register the user's modules. As an option's callback it runs before the command reads its listing."""
    if files:
        from foldcar.car.user_modules import load_components

        for file in files:
            load_components(file)


# These raise FoldcarError if the value (a file or ``-``, a store, a folder) cannot be written.
output_file, output_store, output_folder = _checked(_check_file), _checked(_check_store), _checked(check_output_folder)
thresholds_of_success = _checked(_check_thresholds)

Listing = Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing or design (JSON).")]
StudyStore = Annotated[Path, typer.Argument(metavar="STORE", help="Store of a sweep and perhaps of trials.")]
TrialStore = Annotated[Path, typer.Argument(metavar="STORE", help="Store with the trials.")]
TrialNumber = Annotated[int, typer.Argument(metavar="TRIAL", min=1, help="Number of a trial (see `trials list`).")]
OutputStore = Annotated[
    Path,
    typer.Option(
        "--store", metavar="FILE", callback=output_store, help="Store to write to; created if it does not exist."
    ),
]
NewStore = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="FILE", callback=output_store, help="Store to create; it must not exist."),
]
OutputFolder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder to write the files to.")
]
Picture = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", callback=_checked(_check_picture), help="Picture to draw (.png, .svg, .pdf)."),
]
DesignsFile = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", callback=output_file, help="CSV file to write, a row for each design."),
]
StepsFile = Annotated[
    Path | None,
    typer.Option("--csv", metavar="FILE", callback=output_file, help="CSV file to write, a row for each step."),
]
ExperimentId = Annotated[str, typer.Option("--experiment", metavar="ID", help="Experiment of the listing.")]
OneExperiment = Annotated[str | None, typer.Option("--experiment", metavar="ID", help="Only this experiment.")]
Vehicle = Annotated[
    str | None, typer.Option("--vehicle", metavar="ID", help="Vehicle of the listing; needed if it has several.")
]
Sample = Annotated[
    int,
    typer.Option(
        metavar="K", min=0, max=MAX_ENVIRONMENTS - 1, help="Which sample of environment and car, counted from 0."
    ),
]
Samples = Annotated[
    int | None,
    typer.Option(
        metavar="N", min=1, max=MAX_ENVIRONMENTS, help="Number of sampled environments; default: the listing's."
    ),
]
Seed = Annotated[int, typer.Option(metavar="S", min=0, max=MAX_SEED, help="Random seed.")]
Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=MAX_JOBS, help="Simulators in parallel; default: one per processor."),
]
Engine = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_checked(_check_engine),
        help="Physics engine: side-view (Box2D; fast; left and right wheels on the same ground), multibody (six "
        "degrees of freedom) or mujoco (slow; build it with `make mujoco`).",
    ),
]
Components = Annotated[
    list[Path] | None,
    typer.Option(
        "--components",
        metavar="FILE",
        callback=_checked(_load_modules),
        help="Python file with car modules of your own, for vehicle types.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Simulate on the workers of a Dask scheduler, e.g. tcp://10.0.0.1:8786; local:4 starts 4 workers here.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=MM",
        help="Set a parameter (mm, degrees) or a part, e.g. width=95, W.length=60, tyre=none.",
    ),
]
Material = Annotated[
    str,
    typer.Option(
        metavar="NAME|FILE",
        help="How the film is cut and folded: a preset (silhouette, cricut, laser or scissors) or a JSON file with your "
        "own numbers (see docs/patterns.md).",
    ),
]
Sheet = Annotated[
    str | None, typer.Option(metavar="SIZE", help="Sheet size: a4, letter, a3, 12in, 12x24in or WIDTHxHEIGHT in mm.")
]
Port = Annotated[
    str | None, typer.Option(metavar="PORT", help="Serial port, pseudo-terminal or tcp:HOST:PORT; default: detected.")
]
SimulatedTrials = Annotated[
    bool,
    typer.Option("--simulated-trials", help="Use trials of simulated cars as if built cars had driven them."),
]


def check_scheduler_option(scheduler: str | None, jobs: int | None) -> None:
    """Raise FoldcarError if ``--scheduler`` has an invalid value, or is used with ``--jobs``.

    If there is a scheduler, another process samples the scenes from now on. In this process, the scheduler's threads
    would draw from the same random generators, so that the scenes would not be repeatable.
    """
    if scheduler is not None:
        from foldcar.scenes.fixed_hash import draw_elsewhere
        from foldcar.study.cluster.simulators import check_scheduler

        check_scheduler(scheduler, jobs)
        draw_elsewhere()


@contextlib.contextmanager
def simulators(
    scheduler: str | None, jobs: int | None, carsim: "Carsim", print_line: Callable[[str], None]
) -> "Iterator[Simulators | int]":
    """Yield the simulators to use: the scheduler's workers, or the number of local ones. Raises FoldcarError."""
    if scheduler is None:
        yield jobs or usable_processors()
        return
    from foldcar.study.cluster.simulators import open_cluster

    with open_cluster(scheduler, carsim, print_line) as cluster:
        yield cluster


def check_distinct(inputs: Sequence[Path], outputs: Sequence[Path | None]) -> None:
    """Raise FoldcarError if an output would replace an input or another output of the command."""
    # Why a file may not be written.
    reasons = {file.resolve(): "is read by this command" for file in inputs}
    for output in outputs:
        if output is None or output == STANDARD_OUTPUT:
            continue
        if output.resolve() in reasons:
            raise FoldcarError(f"{output}: {reasons[output.resolve()]}; name another file to write")
        reasons[output.resolve()] = "is named twice"


def design_settings(words: Sequence[str] | None) -> dict[str, float | str]:
    """Parse the values of ``--set``: NAME=VALUE for parameters (mm, degrees), KIND=NAME for parts.

    Example: ["width=95", "tyre=none"] gives {"width": 95.0, "tyre": "none"}. Raises FoldcarError.
    """
    from foldcar.car.parts.catalogue import OPTIONS

    settings: dict[str, float | str] = {}
    for word in words or ():
        key, equals, text = word.partition("=")
        if key in settings:
            first_value = settings[key]
            first_text = first_value if isinstance(first_value, str) else f"{first_value:g}"
            raise FoldcarError(f"--set {word}: {key} is given twice, first as {first_text}")
        if equals and key in OPTIONS:
            settings[key] = text
            continue
        number = _parameter_value(text)
        if not equals or number is None:
            raise FoldcarError(
                f"--set {word}: is neither NAME=MM, as in --set width=95, nor a part, as in --set tyre=none"
            )
        settings[key] = number
    return settings


def _parameter_value(text: str) -> float | None:
    """Return a parameter's value as a number, 1 for `true` and 0 for `false`; None if the text is none of these."""
    if text in ("true", "false"):
        return 1.0 if text == "true" else 0.0
    try:
        return decimal_number(text)
    except ValueError:
        return None


def parse_points(option: str, text: str, low: float = 1.0, high: float = 50.0) -> float:
    """Parse percentage points, such as ``15pp``, to a fraction, 0.15.

    Raises FoldcarError, which names the ``option``, if the text is not ``low`` to ``high`` points.
    """
    match = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*pp\s*", text)
    if match is None:
        raise FoldcarError(f'{option}: "{text}" is not a number of percentage points, as 15pp')
    value = float(match[1])
    if not low <= value <= high:
        raise FoldcarError(f"{option}: {text.strip()} is not within {low:g}pp to {high:g}pp")
    return value / 100
