"""Saves a figure atomically in the formats of its files' suffixes."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from foldcar.errors import FoldcarError
from foldcar.figures.style import drawing_style
from foldcar.outputs import atomic_file

# Metadata to leave out, because they would make two drawings of the same data differ.
UNDATED: dict[str, dict[str, Any]] = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}

# Around what is drawn.
PADDING_IN = 0.08


def check_format(file: Path) -> None:
    """Raise FoldcarError unless the file's suffix is that of a supported format."""
    if file.suffix.lower() not in UNDATED:
        raise FoldcarError(f"{file}: a picture's name ends in one of {', '.join(UNDATED)}")


def save_figure(figure: Any, files: Sequence[Path], dpi: int | None = None, colours: int | None = None) -> None:
    """Save a matplotlib figure to each of ``files`` (.png, .svg or .pdf). Raises FoldcarError.

    ``dpi``: pixels per inch, by default the style's. ``colours`` limits a PNG's colours, which makes the file smaller.
    """
    for file in files:
        check_format(file)
    with drawing_style():
        # Lay the figure out once for all files. This takes as long as drawing it.
        figure.draw_without_rendering()
        edges_in = figure.get_tightbbox().padded(PADDING_IN)
        figure.set_layout_engine("none")
        for file in files:
            suffix = file.suffix.lower()
            options: dict[str, Any] = {} if dpi is None else {"dpi": dpi}
            options |= {"format": suffix[1:], "metadata": UNDATED[suffix], "bbox_inches": edges_in}
            with atomic_file(file) as binary:
                if colours is None or suffix != ".png":
                    figure.savefig(binary, **options)
                else:
                    drawn = io.BytesIO()
                    figure.savefig(drawn, **options)
                    binary.write(with_fewer_colours(drawn.getvalue(), colours))


def with_fewer_colours(png: bytes, colours: int) -> bytes:
    """Return the PNG with that many colours, which is a fraction of its size."""
    smaller = io.BytesIO()
    image = Image.open(io.BytesIO(png)).convert("RGB").quantize(colours, kmeans=1, dither=Image.Dither.NONE)
    image.save(smaller, format="PNG", optimize=True)
    return smaller.getvalue()
