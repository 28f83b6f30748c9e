"""The publication's listings: as printed each mistake is one line; as docs/publication.md changes them they run."""

import re
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes.program import compile_program
from foldcar.scenes.syntax_hints import syntax_hint
from foldcar.study.brackets import unclosed
from foldcar.study.listing_file import read_listing

PROJECT = Path(__file__).parents[3]
PRINTED = (PROJECT / "test" / "host" / "data" / "appendix_a_printed.json").read_text(encoding="utf-8")
DOC = (PROJECT / "docs" / "publication.md").read_text(encoding="utf-8")
APPENDIX_A = DOC[DOC.index("## Appendix A") :].partition("## Appendix C")[0]
# The mistakes of form, each with what mends it.
FORM = (
    ("      }\n      }\n    }\n  },", "      }\n      }]\n    }\n  },"),
    ('"\n        hillWidth"', '"hillWidth"'),
    ("0.3 } }\n  }\n", "0.3 } }\n  }\n}\n"),
)
FIGURES = {"10": "paper_bumps", "11": "paper_bumps_mutated", "12": "ten_random_bumps"}


def mended(count: int) -> str:
    """Appendix A with so many of its mistakes of form mended."""
    text = PRINTED
    for before, after in FORM[:count]:
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text


@pytest.mark.parametrize(
    ("count", "message"),
    [
        (0, 'line 33, column 5: "[" of line 12, column 17 is still open: write "]" before this "}"'),
        (1, 'line 40, column 40: a string has no closing " on its line: write it on one line'),
        (2, 'at the end of the file "{" of line 1, column 1 is still open: write "}"'),
    ],
)
def test_a_mistake_of_form_of_appendix_a_is_one_line(tmp_path: Path, count: int, message: str) -> None:
    file = tmp_path / "a.json"
    file.write_text(mended(count))

    with pytest.raises(FoldcarError) as caught:
        read_listing(file)

    assert str(caught.value) == f"{file}: is not JSON: {message}"


def test_appendix_a_runs_with_the_changes_of_the_table(tmp_path: Path, foldcar: Any) -> None:
    text = mended(3)
    changes = re.findall(r'^\|`("[^`}]*)`\|`("[^`}]*)`\|', APPENDIX_A, re.M)
    assert len(changes) == 5
    # The larger length first: it becomes the smaller one's.
    for before, after in sorted(changes, reverse=True):
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    (tmp_path / "a.json").write_text(text)
    (program,) = re.findall(r"```\n(model model.*?)```", APPENDIX_A, re.S)
    (tmp_path / "middle_hill.scenic").write_text(program)

    done = foldcar("sweep", "a.json", "--store", "s.db", "--jobs", "1")

    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 new run")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": [1, 2]}', None),
        ('// "{"\n{"a": "]", /* [ */ "b": \'}\'}', None),
        ('{"a": "\\""}', None),
        ("{}]", 'line 1, column 3: "]" does not close a bracket; remove it'),
        ("{'a: 1}", "line 1, column 2: a string has no closing ' on its line: write it on one line"),
        ('{\n "a": [}', 'line 2, column 8: "[" of line 2, column 7 is still open: write "]" before this "}"'),
    ],
)
def test_what_is_not_closed_is_found_outside_strings_and_comments(text: str, message: str | None) -> None:
    assert unclosed(text) == message


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("bumpCenter = Point at (0,0)", '"new" before "Point"'),
        ("Bump left of bumpCenter by 0.05,", '"new" before "Bump"'),
        ("ego = Robot at startPos facing endPos",
         '"new" before "Robot" and a comma before "facing"; "facing toward endPos" is the way to a point'),
        ("ego = new Robot at startPos facing endPos", 'a comma before "facing"; "facing toward endPos" is the w'),
        ("new Bump at (0, 1) with height 0.1", 'a comma before "with"'),
    ],
)  # fmt: skip
def test_a_line_of_scenic_2_says_what_scenic_3_wants(line: str, message: str) -> None:
    assert syntax_hint(SyntaxError("invalid syntax"), line).startswith(f"; Scenic 3 wants {message}")
    assert syntax_hint(ValueError("something else"), line) == ""


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ((("new Point", "Point"),), 'TypeError: "X at Y" with X not a vector field. (Perhaps you forgot "new"?)'),
        ((("new Bump", "Bump"),), 'invalid syntax; Scenic 3 wants "new" before "Bump"'),
        ((("new Robot at startPos, facing toward", "Robot at startPos facing"),),
         'invalid syntax; Scenic 3 wants "new" before "Robot" and a comma before "facing"; "facing toward endPos"'),
        (((", facing toward", ", facing"),),
         'TypeError: facing x with x not a heading or orientation; "facing toward endPos" is the way to a point'),
        (((" as elapsedTime", " as\n   elapsedTime"),),
         'invalid syntax; a statement ends with its line: write the name behind "as" on this line'),
    ],
)  # fmt: skip
def test_figure_10_as_printed_says_word_by_word_what_must_change(
    tmp_path: Path, changes: tuple[tuple[str, str], ...], message: str
) -> None:
    # Comments tell of the print, too.
    text = re.sub(r"  # Print.*", "", (PROJECT / "scenarios" / "paper_bumps.scenic").read_text(encoding="utf-8"))
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    file = tmp_path / "figure_10.scenic"
    file.write_text(text)

    with pytest.raises(FoldcarError) as caught:
        compile_program(file, {})

    line = caught.value.lines()[0]
    assert re.match(rf"{re.escape(str(file))}: line \d+: {re.escape(message)}", line), line


@pytest.mark.parametrize("figure", FIGURES)
def test_every_changed_word_of_a_figure_has_a_comment(figure: str) -> None:
    lines = (PROJECT / "scenarios" / f"{FIGURES[figure]}.scenic").read_text(encoding="utf-8").splitlines()

    for number, line in enumerate(lines):
        code = line.partition("#")[0]
        if re.search(r"\bnew\b|\btoward\b", code) and not code.startswith("goal"):
            assert "# Print" in line, (number, line)
    assert f"`{FIGURES[figure]}.scenic`" in DOC or f"scenarios/{FIGURES[figure]}.scenic" in DOC
