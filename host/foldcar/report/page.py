"""The report's page: one HTML file that needs neither other files nor a network. Its parts stand in the folder web/."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from foldcar.figures.style import OUTCOME_COLOURS, OUTCOME_LABELS
from foldcar.inline_svg import inline_svg
from foldcar.page_template import bundle, page_template, script_json
from foldcar.report.advice_slots import Part
from foldcar.report.axis import extent_text, interval_text, parameter_label, success_text, value_text
from foldcar.report.sections import Section
from foldcar.report.trial_sections import TrialSection
from foldcar.simulation.results import OUTCOMES
from foldcar.store.info import StudyInfo

STYLES = ("page.css", "replay.css", "print.css")
# In the order in which they name each other.
PROGRAMS = ("canvas.js", "heat_grid.js", "replay.js", "start.js")


@dataclass(frozen=True)
class Picture:
    """A drawing as SVG text, wide and narrow: the page shows the one that fits."""

    wide: str
    narrow: str


def page_html(
    store_name: str,
    info: StudyInfo | None,
    across: Sequence[Part],
    sections: Sequence[Section],
    driven: Sequence[TrialSection],
    pictures: Mapping[str, Picture],
    report_command: Sequence[str],
) -> str:
    """The page as HTML: swept experiments, then those that have trials only; ``info`` is None if nothing was swept.

    ``across`` are parts on several experiments, which stand before those of each.

    ``pictures`` holds each drawing by its name.
    """
    filters: dict[str, Callable[..., Any]] = {
        "parameter_label": parameter_label,
        "value_text": value_text,
        "assignments": _assignments,
        "extent_text": extent_text,
        "success_text": success_text,
        "interval_text": interval_text,
        "script_json": script_json,
    }
    drawings = [drawing for part in across for drawing in part.drawings]
    drawings += [drawing for section in sections for drawing in section.all_drawings]
    drawings += [drawing for section in driven for drawing in section.all_drawings]
    captions = {drawing.name: drawing.caption for drawing in drawings}
    outcomes = [{"label": OUTCOME_LABELS[name], "colour": OUTCOME_COLOURS[name]} for name in OUTCOMES]
    return page_template("foldcar.report", "web/page.html", filters).render(
        store_name=store_name,
        info=info,
        across=across,
        sections=sections,
        driven=driven,
        svgs={name: _inlined(name, picture, captions[name]) for name, picture in pictures.items()},
        outcome_labels=OUTCOME_LABELS,
        outcome_colours=OUTCOME_COLOURS,
        outcome_names=OUTCOMES,
        outcomes=outcomes,
        report_command=shlex.join(report_command),
        style=Markup("\n".join(_web_file(name) for name in STYLES)),
        program=bundle("place.js") + Markup("\n".join(_web_file(name) for name in PROGRAMS).replace("</", "<\\/")),
    )


def _inlined(name: str, picture: Picture, caption: str) -> Markup:
    """Both sizes; the style sheet shows one of them, and screen readers hear of that one only."""
    wide = inline_svg(picture.wide, name, caption).replace("<svg", '<svg class="wide-figure"', 1)
    narrow = inline_svg(picture.narrow, f"{name}-narrow", caption).replace("<svg", '<svg class="narrow-figure"', 1)
    return Markup(wide + narrow)


def _web_file(name: str) -> str:
    return files("foldcar.report").joinpath(f"web/{name}").read_text(encoding="utf-8")


def _assignments(values: Mapping[str, object]) -> str:
    return ", ".join(
        f"{name} = {value_text(v) if isinstance(v, int | float) else v}" for name, v in values.items()
    )
