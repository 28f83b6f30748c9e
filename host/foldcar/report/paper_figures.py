"""Which figures for papers stand beside the page, as SVG, PNG and PDF, and what each shows.

Input: what the page's data is made of. Output: drawings in the order in which the page lists them.
"""

import hashlib
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from matplotlib.figure import Figure

from foldcar.analysis.effects import Effects
from foldcar.analysis.words import label_and_unit
from foldcar.report.effect_plots import draw_effects, draw_importance, draw_map, effects_caption
from foldcar.report.page_designs import Designs
from foldcar.report.page_effects import importance_rows
from foldcar.report.parameter_plots import draw_feasibility, draw_outcomes, draw_success, draw_times

# What any file system keeps as it is; capitals are not, as some ignore case.
PLAIN = re.compile(r"[a-z0-9-]+(_[a-z0-9-]+)*")
HASHED = re.compile(r"(.*_)?[0-9a-f]{8}")
LONGEST = 40


@dataclass(frozen=True)
class Drawing:
    """A figure: the name of its files without suffix, its caption, and what makes it."""

    name: str
    caption: str
    draw: Callable[[], Figure]


def drawings(
    designs: Designs,
    effects: Effects | None,
    places: list[int],
    thresholds: Sequence[float],
    sample: int,
) -> Iterator[Drawing]:
    """The drawings of an experiment; ``sample`` is the environment whose times are drawn. None of a single design."""
    start = "experiment_" + file_name_part(designs.info.id)
    judged, run = designs.info.success_defined, bool(designs.ends.any())
    if len(designs.values) == 1 and (run or designs.tried.any()):
        (name,) = designs.values
        label = label_and_unit(name)[0]
        if judged:
            yield Drawing(
                f"{start}_feasibility_by_{name}",
                f"Success by {label}: what simulation and trials say, with 95 % bands",
                partial(draw_feasibility, designs, thresholds),
            )
        if judged and run:
            yield Drawing(
                f"{start}_success_by_{name}",
                f"Mean success by {label} over all environments, with {designs.interval_name} 95 % intervals",
                partial(draw_success, designs, thresholds),
            )
            if sample < designs.info.environments:
                yield Drawing(
                    f"{start}_time_by_{name}",
                    f"Time to cross by {label} in environment {sample}",
                    partial(draw_times, designs, sample),
                )
        if run:
            yield Drawing(f"{start}_outcomes_by_{name}", f"Outcomes by {label}", partial(draw_outcomes, designs))
    if len(places) > 1 and effects is not None:
        rows = importance_rows(effects, places)
        caption = effects_caption(effects, len(places))
        yield Drawing(f"{start}_effects", caption, partial(draw_effects, designs, effects, places, thresholds))
        if rows:
            yield Drawing(
                f"{start}_importance",
                "Importance: the share of the variance of success over designs that goes if a parameter is fixed",
                partial(draw_importance, designs, rows),
            )
        ranked = [row["parameter"] for row in rows] or places
        two = (ranked[0], ranked[1])
        first, second = (list(designs.values)[place] for place in two)
        yield Drawing(
            f"{start}_map_by_{first}_and_{second}",
            f"Success over {label_and_unit(first)[0]} and {label_and_unit(second)[0]} by the smooth model, a mean over "
            "the same combinations of the others",
            partial(draw_map, designs, effects, places, two, thresholds),
        )


def file_name_part(name: str) -> str:
    """``name`` itself if it is short and plain, else what is plain of it and eight digits of its SHA-256."""
    if len(name) <= LONGEST and PLAIN.fullmatch(name) and not HASHED.fullmatch(name):
        return name
    plain = re.sub("[^a-z0-9-]+", "_", name.lower())[:LONGEST].strip("_")
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{plain}_{digest}" if plain else digest
