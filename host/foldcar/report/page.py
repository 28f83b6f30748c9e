"""The report's page: one HTML file that needs neither other files nor a network."""

import shlex
from collections.abc import Callable, Mapping, Sequence

from markupsafe import Markup

from foldcar.figures.style import OUTCOME_LABELS
from foldcar.inline_svg import inline_svg
from foldcar.page_template import page_template
from foldcar.report.axis import extent_text, interval_text, parameter_label, percent_text, value_text
from foldcar.report.sections import Section
from foldcar.report.trial_sections import TrialSection
from foldcar.store.info import StudyInfo


def page_html(
    store_name: str,
    info: StudyInfo | None,
    sections: Sequence[Section],
    driven: Sequence[TrialSection],
    svgs: Mapping[str, str],
    report_command: Sequence[str],
) -> str:
    """The page as HTML: swept experiments, then those that have trials only; ``info`` is None if nothing was swept.

    ``svgs`` holds the SVG text of each drawing by the drawing's name.
    """
    filters: dict[str, Callable[..., str]] = {
        "parameter_label": parameter_label,
        "value_text": value_text,
        "assignments": _assignments,
        "extent_text": extent_text,
        "percent_text": percent_text,
        "interval_text": interval_text,
    }
    inlined = {
        drawing.name: Markup(inline_svg(svgs[drawing.name], drawing.name, drawing.caption))
        for drawings in [*(one.drawings for one in sections), *(one.drawings for one in driven)]
        for drawing in drawings
    }
    return page_template("foldcar.report", "page.html", filters).render(
        store_name=store_name,
        info=info,
        sections=sections,
        driven=driven,
        svgs=inlined,
        outcome_labels=OUTCOME_LABELS,
        report_command=shlex.join(report_command),
    )


def _assignments(values: Mapping[str, object]) -> str:
    return ", ".join(
        f"{name} = {value_text(v) if isinstance(v, int | float) else v}" for name, v in values.items()
    )
