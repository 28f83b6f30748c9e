"""A study's figures for notebooks: matplotlib axes and pictures in HTML."""

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from foldcar.errors import FoldcarError
from foldcar.notebook_html import image_html
from foldcar.shown_text import shown_value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from foldcar.report.paper_figures import PaperFigure
    from foldcar.report.reported_experiment import ReportedExperiment

# The size of a picture in a notebook (inches), its resolution (pixels per inch) and its number of colours.
SIZE_IN, DPI, COLOURS = (7.2, 4.0), 110, 64


def drawing_of(
    experiments: "Mapping[str, ReportedExperiment]", kinds: Sequence[str], experiment: str | None, caller: str
) -> "PaperFigure":
    """Return an experiment's first drawing whose kind is one of ``kinds``.

    If ``experiment`` is None, it is the only experiment. Raises FoldcarError, which begins with ``caller``, if there is
    no such experiment, if there are several, or if the experiment has no drawing of these kinds.
    """
    from foldcar.report.paper_figures import drawings

    if experiment is None and len(experiments) != 1:
        raise FoldcarError(f"{caller}: choose one of the experiments with experiment=: {', '.join(experiments)}")
    name = next(iter(experiments)) if experiment is None else experiment
    if name not in experiments:
        raise FoldcarError(f'{caller}: there is no experiment "{name}"; there are {", ".join(experiments)}')
    drawn = experiments[name]
    possible = list(drawings(drawn.columns, drawn.effects, drawn.parameter_indices, drawn.thresholds))
    for drawing in possible:
        if drawing.kind in kinds:
            return drawing
    others = ", ".join(drawing.kind for drawing in possible) or "nothing"
    raise FoldcarError(f"{caller}: experiment {name} has nothing to draw here; its report shows {others}")


def drawn(drawing: "PaperFigure", figure: Any = None) -> "Figure":
    """Draw into ``figure``, an empty figure; without one, into a new figure of pyplot, which a notebook shows.

    Raises FoldcarError if it is no figure.
    """
    from matplotlib.figure import FigureBase

    from foldcar.figures.style import drawing_style

    if not isinstance(figure, FigureBase | None):
        raise FoldcarError(f"figure: {shown_value(figure)} is neither a figure nor a subfigure of matplotlib")
    with drawing_style():
        if figure is None:
            from matplotlib import pyplot

            figure = pyplot.figure(figsize=SIZE_IN, layout="constrained")
        return drawing.draw(figure=figure)


def picture_html(figure: "Figure") -> str:
    """Return an <img> of the figure."""
    from foldcar.figures.output import with_fewer_colours

    binary = io.BytesIO()
    figure.savefig(binary, format="png", dpi=DPI, facecolor="white")
    return image_html(with_fewer_colours(binary.getvalue(), COLOURS))
