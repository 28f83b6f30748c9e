"""`foldcar new`: a small project to start from."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.json_option import Json, print_json
from foldcar.errors import FoldcarError
from foldcar.output_folder import make_output_folder

FILES = ("README.md", "study.json", "yard.scenic")


def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make; an empty one may be there.")],
    as_json: Json = False,
) -> None:
    """Make a small project to start from.

    A family of cars, an environment, and a README on what to type.

    \b
    Example: foldcar new yard
    """
    from importlib.resources import files

    if folder.is_dir() and any(folder.iterdir()):
        raise FoldcarError(f"{folder}: is not empty; name a new folder")
    made = make_output_folder(folder)
    written: list[Path] = []
    try:
        for name in FILES:
            written.append(folder / name)
            written[-1].write_bytes((files("foldcar.study") / "starter" / name).read_bytes())
    except OSError as error:
        for file in written:
            file.unlink(missing_ok=True)
        if made:
            folder.rmdir()
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    if as_json:
        print_json({"folder": folder, "files": written})
        return
    typer.echo(f"{folder}: {', '.join(FILES)}; now type:")
    typer.echo(f"  cd {shlex.quote(str(folder))}")
    typer.echo("  foldcar sweep study.json --store yard.db")
    typer.echo("  foldcar report yard.db -o report")
