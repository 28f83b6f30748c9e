"""Saves a figure in the format its file's name asks for, wholly or not at all."""

from pathlib import Path
from typing import Any

from foldcar.atomic_file import atomic_file
from foldcar.errors import FoldcarError
from foldcar.figures.style import RC

# The metadata that would make two drawings of the same data differ.
UNDATED: dict[str, dict[str, Any]] = {
    ".png": {},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}


def check_format(file: Path) -> None:
    """Raise FoldcarError unless the file's name ends in one of the formats figures are saved in."""
    if file.suffix.lower() not in UNDATED:
        raise FoldcarError(f"{file}: a picture's name ends in one of {', '.join(UNDATED)}")


def save_figure(figure: Any, file: Path) -> None:
    """Save a matplotlib figure to ``file`` (.png, .svg or .pdf). Raises FoldcarError."""
    import matplotlib

    check_format(file)
    suffix = file.suffix.lower()
    with matplotlib.rc_context(RC), atomic_file(file) as binary:
        figure.savefig(
            binary, format=suffix[1:], metadata=UNDATED[suffix], bbox_inches="tight", pad_inches=0.08
        )
