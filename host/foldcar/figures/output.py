"""Saves a figure atomically in the format of its file's suffix."""

import io
from pathlib import Path
from typing import Any

from PIL import Image

from foldcar.errors import FoldcarError
from foldcar.figures.style import drawing_style
from foldcar.outputs import atomic_file

# Metadata to leave out, because they would make two drawings of the same data differ.
UNDATED: dict[str, dict[str, Any]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def check_format(file: Path) -> None:
    """Raise FoldcarError unless the file's suffix is that of a supported format."""
    if file.suffix.lower() not in UNDATED:
        raise FoldcarError(f"{file}: a picture's name ends in one of {', '.join(UNDATED)}")


def save_figure(figure: Any, file: Path, dpi: int | None = None, colours: int | None = None) -> None:
    """Save a matplotlib figure to ``file`` (.png, .svg or .pdf). Raises FoldcarError.

    ``dpi``: pixels per inch, by default the style's. ``colours`` limits a PNG's colours, which makes the file smaller.
    """
    check_format(file)
    suffix = file.suffix.lower()
    options: dict[str, Any] = {} if dpi is None else {"dpi": dpi}
    options |= {"format": suffix[1:], "metadata": UNDATED[suffix], "bbox_inches": "tight", "pad_inches": 0.08}
    with drawing_style(), atomic_file(file) as binary:
        if colours is None or suffix != ".png":
            figure.savefig(binary, **options)
        else:
            drawn = io.BytesIO()
            figure.savefig(drawn, **options)
            _with_fewer_colours(drawn, colours).save(binary, format="PNG", optimize=True)


def _with_fewer_colours(drawn: io.BytesIO, colours: int) -> Image.Image:
    return Image.open(drawn).convert("RGB").quantize(colours, kmeans=1, dither=Image.Dither.NONE)
