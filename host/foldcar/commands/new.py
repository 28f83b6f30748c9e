"""`foldcar new` writes a small project to start from, or the files of an example of the documentation."""

import shlex
import shutil
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import print_lines
from foldcar.errors import FoldcarError
from foldcar.installation import PACKAGE, source_tree
from foldcar.outputs import make_output_folder

FILES = ("README.md", "study.json", "yard.scenic")
FIRST_COMMANDS = ("foldcar sweep study.json --store study.db", "foldcar report study.db -o report")
STUDY = ("scenarios/width_study.json", "scenarios/step_pyramids.scenic", "scenarios/published_trials.csv")
# For each example: its files, and its commands. Files have the paths of a checkout, so that the documentation's commands
# work.
EXAMPLES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "width_study": (
        (*STUDY, "examples/study.ipynb"),
        (
            "foldcar sweep scenarios/width_study.json --store study.db",
            "foldcar trials import study.db scenarios/published_trials.csv",
            "foldcar report study.db -o report",
        ),
    ),
    "published_cars": (
        ("patterns/published_cars.json", "patterns/hinged.json", "patterns/six_wheels.json"),
        ("foldcar pattern patterns/published_cars.json --vehicle w95 -o car",),
    ),
    "obstacle_course": (
        ("scenarios/obstacle_course.json", "scenarios/obstacle_course.scenic"),
        (
            "foldcar sample scenarios/obstacle_course.scenic -n 3 --plot course.png",
            "foldcar sweep scenarios/obstacle_course.json --store study.db",
        ),
    ),
    "six_wheels": (
        ("examples/six_wheels.json", "scenarios/low_kerbs.scenic"),
        (
            "foldcar sweep examples/six_wheels.json --store study.db",
            "foldcar report study.db -o report",
        ),
    ),
    "optimize": (
        ("examples/design_space.json", "scenarios/step_pyramids.scenic"),
        ("foldcar optimize examples/design_space.json --store study.db --designs 60 --samples 50",),
    ),
}


def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to create; it may exist if it is empty.")],
    example: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"Write the files of this example: {', '.join(EXAMPLES)}.")
    ] = None,
) -> None:
    """Create a small project to start from.

    The project has a family of cars, an environment, and a README with the next commands. With --example, the folder
    gets the files that the documentation's commands use.

    \b
    Example: foldcar new yard
             foldcar new study --example width_study
    """
    if example is not None and example not in EXAMPLES:
        raise FoldcarError(f"--example {example}: unknown example; choose one of {', '.join(EXAMPLES)}")
    if folder.is_dir() and any(folder.iterdir()):
        raise FoldcarError(f"{folder}: is not empty; name a new folder")
    names, commands = (FILES, FIRST_COMMANDS) if example is None else EXAMPLES[example]
    # A clone of the project has the files of the examples at their places; an installed package has copies.
    examples_folder = source_tree() or PACKAGE / "examples"
    source = files("foldcar.study") / "starter" if example is None else examples_folder
    try:
        contents = {name: (source / name).read_bytes() for name in names}
    except OSError as error:
        raise FoldcarError(f"--example: {error.filename} is not in this installation") from error
    _write_files(folder, contents)
    lines = [f"{folder}: {', '.join(names)}; now type:", f"  cd {shlex.quote(str(folder))}"]
    lines += [f"  {command}" for command in commands]
    print_lines(*lines)


def _write_files(folder: Path, contents: Mapping[str, bytes]) -> None:
    """Write files with these ``contents``, by their names, into an empty or new folder.

    If this fails or is interrupted, everything that was written is removed again. Raises FoldcarError.
    """
    was_created = make_output_folder(folder)
    try:
        for name, content in contents.items():
            file = folder / name
            file.parent.mkdir(exist_ok=True)
            file.write_bytes(content)
    except KeyboardInterrupt:
        _remove(folder, was_created)
        raise
    except OSError as error:
        _remove(folder, was_created)
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error


def _remove(folder: Path, was_created: bool) -> None:
    """Remove everything in ``folder``, which was empty before, and the folder itself if this command created it."""
    for entry in folder.iterdir():
        shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
    if was_created:
        folder.rmdir()
