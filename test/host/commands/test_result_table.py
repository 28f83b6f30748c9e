"""Tables of results are readable on terminals of every width."""

import io

from foldcar.shown_console import ResultTable, shown_console

HEADS = ("design", "runs", "passed %", "95 % interval", "why")
ROWS = [(f"width {width} mm, radius 60 mm", "20", "100.0", "83.9–100.0", "the best chance") for width in (75, 115)]


def printed(width: int) -> list[str]:
    """The lines of a table of ROWS on a console of this width."""
    table = ResultTable(*HEADS, left=("design", "why"))
    for row in ROWS:
        table.add_row(*row)
    file = io.StringIO()
    table.print_on(shown_console(width, file=file))
    lines = file.getvalue().splitlines()
    assert max(map(len, lines)) <= width
    return [line.rstrip() for line in lines]


def test_a_table_that_is_too_wide_gets_higher_titles_then_higher_cells_then_blocks() -> None:
    by_width = {width: printed(width) for width in (100, 75, 66, 50)}

    first, second = by_width[100][1:]
    assert "95 % interval" in by_width[100][0]
    assert first.startswith("width 75 mm, radius 60 mm ") and second.endswith("the best chance")
    # Higher titles.
    assert len(by_width[75]) == 2 + 2 and "95 % interval" not in by_width[75][0]
    assert by_width[75][3].split()[:5] == ["width", "115", "mm,", "radius", "60"]
    # Higher cells: only those that are aligned left wrap, and not inside a word.
    words = " ".join(by_width[66]).split()
    assert sorted(words) == sorted(" ".join([*HEADS, *ROWS[0], *ROWS[1]]).split())
    assert len(by_width[66]) > 4
    # Blocks.
    block = [f"{head:<13}  {cell}" for head, cell in zip(HEADS, ROWS[0], strict=True)]
    assert by_width[50][: len(block) + 1] == [*block, ""] and len(by_width[50]) == 2 * len(block) + 2
