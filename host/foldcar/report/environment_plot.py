"""The report's parts on success by a parameter of the environment, over experiments that differ in nothing else."""

from collections.abc import Iterable

from foldcar.report.advice_slots import Part
from foldcar.report.axis import parameter_label, value_text
from foldcar.report.design_table import Count, DesignTable, read_table
from foldcar.report.environment_groups import EnvironmentGroup, environment_groups
from foldcar.report.figure_options import FigureOptions
from foldcar.report.file_names import file_name_part
from foldcar.report.map_part import map_drawing, remarks, slices_drawing, tables
from foldcar.report.map_plan import Panel, plan_map
from foldcar.report.slices import Slices
from foldcar.store.info import ExperimentInfo
from foldcar.store.reader import Store


def environment_parts(store: Store, infos: Iterable[ExperimentInfo], options: FigureOptions) -> list[Part]:
    """A part for each parameter in one number of which experiments differ. StoreError."""
    groups = environment_groups(infos)
    joined = [(group, *joined_table(store, group)) for group in groups]
    shown = [one for one in joined if one[2].cells]
    return [_part(number, *one, options) for number, one in enumerate(shown, 1)]


def joined_table(store: Store, group: EnvironmentGroup) -> tuple[str, DesignTable]:
    """The designs of all experiments of a group by the environment's parameter, then their own; that parameter's name."""
    cells: dict[tuple[float, ...], Count] = {}
    names: tuple[str, ...] = ()
    for value, info in group.experiments.items():
        table = read_table(store, info)
        names = table.names
        cells |= {(value, *design): count for design, count in table.cells.items()}
    name = group.parameter if group.parameter not in names else f"{group.parameter} of the environment"
    return name, DesignTable((name, *names), cells)


def _part(number: int, group: EnvironmentGroup, name: str, table: DesignTable, options: FigureOptions) -> Part:
    thresholds = options.thresholds(next(iter(group.experiments.values())))
    plan = plan_map(table, name)
    designs = {values[1:] for values in table.cells}
    # Without a plan there is one design.
    panels = plan.panels if plan is not None else (Panel(name, None, {}, table.where(_only_design(table, name))),)
    start = f"across_{number}_{file_name_part(group.parameter)}"
    slices = Slices(panels[0] if plan is None else plan.middle, name, _overall(table) if len(designs) > 1 else {})
    drawings = [slices_drawing(slices, thresholds, f"{start}_success")]
    if plan is not None:
        drawings.append(map_drawing(plan, thresholds, f"{start}_map_by_{plan.y}"))
    return Part(_title(name, group), [*group.remarks, *remarks(panels)], drawings, tables(panels))


def _only_design(table: DesignTable, name: str) -> dict[str, float]:
    """The values of the parameters other than ``name``, of which there is one each."""
    return {other: table.values(other)[0] for other in table.names if other != name}


def _overall(table: DesignTable) -> dict[float, list[Count]]:
    """The designs that have runs at every value of the first parameter, by that value; nothing if there are none."""
    by_value: dict[float, dict[tuple[float, ...], Count]] = {}
    for (value, *design), count in table.cells.items():
        by_value.setdefault(value, {})[tuple(design)] = count
    everywhere = set.intersection(*(set(designs) for designs in by_value.values()))
    if len(everywhere) < 2:
        return {}
    return {value: [designs[one] for one in sorted(everywhere)] for value, designs in sorted(by_value.items())}


def _title(name: str, group: EnvironmentGroup) -> str:
    info = next(iter(group.experiments.values()))
    others = ", ".join(
        f"{key} {value_text(value) if isinstance(value, int | float) else value}" for key, value in group.others.items()
    )
    under = "" if info.under is None else f", under {info.under}"
    under += f", in {info.engine}" if info.engine else ""
    return f"Success by {parameter_label(name)} in {info.scenic_program}{', ' + others if others else ''}{under}"

