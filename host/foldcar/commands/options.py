"""The options and arguments that commands share, and what their values mean."""

import contextlib
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.car.parts.choices import OPTIONS
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors
from foldcar.outputs import check_output_file, check_output_folder, check_replaceable
from foldcar.study.limits import MOST_JOBS
from foldcar.typed import decimal_number, did_you_mean

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim
    from foldcar.study.chunks import Simulators
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import Experiment, Study

Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object, and nothing else.")]


def print_json(result: Mapping[str, Any]) -> None:
    """Print the object in ASCII; paths become texts, and a number that is none (NaN, infinite) null."""
    typer.echo(json.dumps(_plain(result), indent=2, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", min=1, max=MOST_JOBS, help="Simulators in parallel; default: one per processor."),
]


def _known(engine: str) -> str:
    from foldcar.simulation.engines import ENGINES, TOLD

    if engine not in ENGINES:
        raise typer.BadParameter(f'"{engine}" is none of {", ".join(TOLD)}{did_you_mean(engine, TOLD)}')
    return engine


Engine = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_known,
        help="side-view (Box2D: quick, the same ground under both tracks), multibody (six degrees of freedom), or mujoco "
        "(slow, `make mujoco` builds it).",
    ),
]


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


Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Simulate at the workers of a Dask scheduler, as tcp://10.0.0.1:8786; local:4 starts 4 workers here.",
    ),
]


def check_scheduler_option(scheduler: str | None, jobs: int | None) -> None:
    """FoldcarError if the option's value is none, or stands beside ``--jobs``."""
    if scheduler is not None:
        from foldcar.cluster.connection import check_scheduler

        check_scheduler(scheduler, jobs)


@contextlib.contextmanager
def simulators(
    scheduler: str | None, jobs: int | None, carsim: "Carsim", say: Callable[[str], None]
) -> "Iterator[Simulators | int]":
    """Where the command simulates: at the scheduler's workers, or in ``jobs`` simulators here. FoldcarError."""
    if scheduler is None:
        yield jobs or usable_processors()
        return
    from foldcar.cluster.connection import open_cluster

    with open_cluster(scheduler, carsim, say) as cluster:
        yield cluster


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


Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=MM", help="Choose a parameter or a part, e.g. width=95, W.length=60, tyre=none."),
]


def design_settings(words: Sequence[str]) -> dict[str, float | str]:
    """Parse NAME=MM words to values (mm or degrees) by parameter or names of parts by kind; FoldcarError."""
    settings: dict[str, float | str] = {}
    for word in words:
        key, equals, text = word.partition("=")
        if key in settings:
            first = settings[key]
            shown = first if isinstance(first, str) else f"{first:g}"
            raise FoldcarError(f"--set {word}: {key} is given twice, first as {shown}")
        if equals and key in OPTIONS:
            settings[key] = text
            continue
        try:
            settings[key] = decimal_number(text)
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


def under_calibration(
    study: "Study", store: Path, name: str | None, reality: Path | None = None
) -> "tuple[Study, Callable[[Experiment], Environment]]":
    """The study and what makes its environments: changed ones if a calibration or a file is given. FoldcarError."""
    from foldcar.study.environments import Environment

    if name is None and reality is None:
        return study, Environment
    if name is not None and reality is not None:
        raise FoldcarError("--calibration and --reality: both say what to simulate with; give one of them")
    from foldcar.calibration.environment import as_calibration, calibrated_environment, calibrated_study, read_reality
    from foldcar.store.calibrations import calibration_named
    from foldcar.store.reader import Store

    if name is None:
        assert reality is not None
        calibration = as_calibration(reality, read_reality(reality))
    else:
        with Store.open(store) as opened:
            calibration = calibration_named(opened, name)
    return calibrated_study(study, calibration), partial(calibrated_environment, calibration=calibration)


SimulatedTrials = Annotated[
    bool, typer.Option("--simulated-trials", help="Also trials of simulated cars, marked as such and counted apart.")
]
SimulatedTrialsInstead = Annotated[
    bool, typer.Option("--simulated-trials", help="Go by the trials of simulated cars instead of built ones.")
]


StoreFile = Annotated[Path, typer.Argument(metavar="STORE", help="The store that holds the trials.")]
Number = Annotated[int, typer.Argument(metavar="TRIAL", min=1, help="The trial's number, as `trials list` shows it.")]
