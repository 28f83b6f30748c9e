"""The report's part on success over two design parameters: a map with contours, slices through it, a table of designs."""

from collections.abc import Sequence
from functools import partial

from foldcar.report.advice_slots import Drawing, Part, Table
from foldcar.report.axis import parameter_label
from foldcar.report.design_matrix import design_matrix
from foldcar.report.design_table import read_table
from foldcar.report.figure_options import FigureOptions
from foldcar.report.file_names import file_name_part
from foldcar.report.heat_map import draw_map
from foldcar.report.map_plan import MapPlan, Panel, plan_map
from foldcar.report.slices import Slices, draw_slices
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store


def map_parts(store: Store, info: ExperimentInfo, options: FigureOptions) -> list[Part]:
    """The part of an experiment in which at least two parameters vary; no part otherwise.

    StoreError.
    """
    if not info.success_defined or len(info.varied) < 2:
        return []
    plan = plan_map(read_table(store, info))
    if plan is None:
        return []
    thresholds = options.thresholds(info)
    start = "experiment_" + file_name_part(info.id)
    drawings = [map_drawing(plan, thresholds, f"{start}_map_by_{plan.x}_and_{plan.y}")]
    for along in (plan.x, plan.y):
        slices = Slices(plan.middle, along)
        drawings.append(slices_drawing(slices, thresholds, f"{start}_slices_by_{along}"))
    x, y = parameter_label(plan.x), parameter_label(plan.y)
    return [Part(f"Success over {x} and {y}", remarks(plan.panels), drawings, tables(plan.panels))]


def map_drawing(plan: MapPlan, thresholds: Sequence[float], name: str) -> Drawing:
    """The map with its caption."""
    highest = 100 * max(thresholds)
    names = f"{parameter_label(plan.x)} and {parameter_label(plan.y)}"
    text = f"Success over {names}: each cell is a design's share of passed runs."
    if not all(panel.table.single for panel in plan.panels):
        text += f" Hatched: its own 95 % interval leaves open on which side of {highest:g} % it is."
    if any(panel.model is not None for panel in plan.panels):
        text += (
            " Lines: where a smooth model of the cells crosses the thresholds. It takes runs as independent; designs"
            " meet the same environments, so neighbours err together."
        )
    text += f" {plan.choice}" if plan.choice else ""
    return Drawing(name, text, partial(draw_map, plan, thresholds))


def slices_drawing(slices: Slices, thresholds: Sequence[float], name: str) -> Drawing:
    """Slices of a map with their caption."""
    panel, along = slices.panel, parameter_label(slices.along)
    text = f"Success against {along}"
    if slices.fixed is not None:
        count = len(panel.table.values(slices.fixed))
        shown = "" if len(slices.values) == count else f" ({len(slices.values)} of {count})"
        text += f" at fixed values of {parameter_label(slices.fixed)}{shown}"
    text += f", with {panel.fixed_text}" if panel.fixed else ""
    if panel.table.single:
        text += ". Each point is one run: that is no share, so it has no interval."
    else:
        text += f". Points: shares of runs with {panel.table.interval_name} 95 % intervals."
    if panel.model is not None:
        text += " Curve and band: the smooth model."
    if slices.overall:
        held = " with an interval that holds although they share environments (Bonferroni),"
        interval = "" if panel.table.single else held
        text += f" First panel: the mean of all designs{interval} and the range from the worst design to the best."
    return Drawing(name, text, partial(draw_slices, slices, thresholds))


def remarks(panels: Sequence[Panel]) -> list[str]:
    """What a reader must know of a map's panels."""
    if any(panel.table.single for panel in panels):
        return [
            "Each design has one run of each environment: it passed or not. More sampled environments would show a share."
        ]
    without = sum(panel.model is None for panel in panels)
    if not without:
        return []
    where = "" if without == len(panels) else f" in {without} of {len(panels)} panels"
    return [f"No smooth model is drawn{where}: it needs at least 4 designs with runs that differ in each axis."]


def tables(panels: Sequence[Panel]) -> list[Table]:
    """The tables of a map's panels that are not too large."""
    return [table for panel in panels if (table := design_matrix(panel)) is not None]
