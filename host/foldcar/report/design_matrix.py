"""The table of a map of success: a row for each value of one parameter, a column for each of the other."""

from foldcar.report.advice_slots import Table
from foldcar.report.axis import interval_text, parameter_label, value_text
from foldcar.report.design_table import Count
from foldcar.report.map_plan import Panel

# Designs; the export has them all.
MOST_CELLS = 1000


def design_matrix(panel: Panel) -> Table | None:
    """The designs of a panel, shares in per cent; None if they are more than MOST_CELLS."""
    table = panel.table
    if len(table.cells) > MOST_CELLS:
        return None
    counts = {count.runs for count in table.cells.values()}
    alike = len(counts) == 1
    each = "1 run" if counts == {1} else f"{min(counts)} runs" if alike else "passed and all runs"
    fixed = f" with {panel.fixed_text}" if panel.fixed else ""
    what = f"Passed (%){fixed}, with {table.interval_name} 95 % intervals; {each} of each design"
    xs = table.values(panel.x)
    if panel.y is None:
        rows = [[value_text(x), _cell(table.cells[(x,)], alike)] for x in xs]
        return Table(what, [parameter_label(panel.x), "passed"], rows)
    at_x = table.names.index(panel.x)
    rows = []
    for y in table.values(panel.y):
        found = [table.cells.get((x, y) if at_x == 0 else (y, x)) for x in xs]
        rows.append([value_text(y), *("–" if count is None else _cell(count, alike) for count in found)])
    corner = f"{parameter_label(panel.y)} \\ {parameter_label(panel.x)}"
    return Table(what, [corner, *map(value_text, xs)], rows)


def _cell(count: Count, alike: bool) -> str:
    text = f"{100 * count.success:.0f} ({interval_text(count.interval)})"
    return text if alike else f"{text}, {count.passed} of {count.runs}"
