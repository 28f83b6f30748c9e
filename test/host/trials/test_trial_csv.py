"""Trials from CSV files: what is read, and what is refused, by line and column, with nothing stored."""

from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.trials.csv_import import read_trials

HEADER = "vehicle_type,width_mm,outcome,count,source\n"


def read(folder: Path, text: str) -> list[dict[str, Any]]:
    """The trials of a file with that text."""
    (folder / "t.csv").write_bytes(text.encode())
    return read_trials(folder / "t.csv", "1")


def column(name: str, *cells: str) -> str:
    """A file with one more column: the cells, each of a trial that alone would be read."""
    rows = "".join(f"W_B_W,95,passed,1,p,{cell}\n" for cell in cells)
    return f"{HEADER.strip()},{name}\n{rows}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEADER, "contains no trials"),
        ("vehicle_type,outcome\nW_B_W,passed\n", 'has no column "source"'),
        ("vehicle_type,outcome,source,colour\n", 'unknown column "colour"; known: vehicle_type'),
        ("Vehicle_type,outcome,source\n", 'unknown column "Vehicle_type"; .*; did you mean "vehicle_type"'),
        ("vehicle_type|outcome|source\n", r'its columns are separated by "\|"; separate them by commas or semicolons'),
        (HEADER + "W_B_W,95,passed,1\n", "line 2: has 4 cells, the header 5"),
        (HEADER + "\nW_B_W,95,flew,1,me\n", 'line 3: outcome: "flew" is not one of passed, '),
        (HEADER + "# a comment\nW_B_W,95,passed,1,me\n", "line 2: has 1 cell, the header 5"),
        (HEADER + "W_B_W,95,passed,1,me,more\n", "line 2: has 6 cells, the header 5"),
        (HEADER + 'W_B_W,95,passed,1,"me\n', "line 2: unexpected end of data"),
        (HEADER + 'W_B_W,95,passed,1,"m"e\n', "line 2: ',' expected after '\"'"),
        (HEADER + 'W_B_W,95,passed,1,"me\nand\r\nyou"\n\n,,,,\nW_B_W,95,flew,1,me\n', 'line 7: outcome: "flew"'),
        (HEADER.replace(",", ";") + "W_B_W;9,5,1;passed;1;me\n", 'line 2: width_mm: "9.5.1" is not a number'),
        (
            HEADER.replace(",", ";") + "W_B_W;95,5;passed;1;me\nW_B_W;1.095;passed;1;me\n",
            '"95,5" in line 2 beside "1.095" in line 3: use only decimal commas, without points',
        ),
        (column("note", "a\0b"), r"is not UTF-8 text \(it contains NUL characters\): save it as UTF-8"),
        (HEADER + "W_B_W,95,pased,1,me\n", 'line 2: outcome: "pased" is not .*; did you mean "passed"'),
        (HEADER + "W_B_W,95,passed,1_0,me\n", 'line 2: count: "1_0" is not a whole number'),
        (HEADER + "W_B_W,95,passed,0,me\n", "line 2: count: 0 is below the minimum 1"),
        (HEADER + "W_B_W,95,passed,200000,me\n", "line 2: count: 200000 is above the maximum 100000"),
        (HEADER + "W_B_W,20,passed,1,me\n", "line 2: width: 20 is below the minimum 53.65"),
        (HEADER + "W_B_W,9_5,passed,1,me\n", 'line 2: width_mm: "9_5" is not a number'),
        (HEADER + "W_X,95,passed,1,me\n", 'line 2: "W_X" has unknown module "X"'),
        (HEADER + "W_B_W,95,passed,1,\n", "line 2: source: is empty"),
        (HEADER + "W_B_W,,passed,1,me\n", "line 2: has no parameters of the car; give some of width_mm, "),
        (column("experiment", '"a\nb"'), r'line 2: experiment: "a\\nb" has line breaks'),
        (column("car", "real"), 'line 2: car: "real" is not one of built, simulated'),
        (column("note", "x" * 140_000), r"line 2: field larger than field limit \(131072\)"),
        (column("sample", str(2**63)), "line 2: sample: 9223372036854775808 is above the maximum 9223372036854775807"),
        (column("elapsed_time_s", "", "1e300"), "line 3: elapsed_time_s: 1e300 is above the maximum 86400"),
        (column("started_utc", "yesterday"), "line 2: started_utc: .* such as 2026-05-01T09:30:00"),
    ],
)
def test_what_cannot_be_is_named_with_line_and_column(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FoldcarError, match=rf"t\.csv: {message}"):
        read(tmp_path, text)


def test_a_bad_row_keeps_the_others_out(tmp_path: Path, refused: Any) -> None:
    (tmp_path / "t.csv").write_text(column("elapsed_time_s", "1", "x"))

    message = refused("trials", "import", "s.db", "t.csv", "--experiment", "1")

    assert message == 't.csv: line 3: elapsed_time_s: "x" is not a number'
    assert not (tmp_path / "s.db").exists()


def test_a_time_of_minus_0_is_0(tmp_path: Path) -> None:
    (trial,) = read(tmp_path, column("elapsed_time_s", "-0.0"))
    assert f"{trial['elapsed_time_s']:.2f}" == "0.00"


def test_outcomes_are_read_as_a_spreadsheet_capitalises_them_and_times_in_utc(tmp_path: Path) -> None:
    times = ("2026-05-01T09:30:00+02:00", "2026-05-01T09:30:00Z", "2026-05-01")
    cells = ("Passed,p,Built", "NOT_PASSED,p,", "stuck,p,simulated")
    rows = [f"W_B_W,95,{cell},{time}\n" for cell, time in zip(cells, times, strict=True)]
    messages = read(tmp_path, "vehicle_type,width_mm,outcome,source,car,started_utc\n" + "".join(rows))

    outcomes = [("passed", "built"), ("not_passed", "built"), ("stuck", "simulated")]
    assert [(trial["outcome"], trial["car"]) for trial in messages] == outcomes
    assert [trial["started_utc"] for trial in messages] == ["2026-05-01T07:30:00+00:00", *times[1:]]


def test_a_cell_may_have_line_breaks_and_a_row_may_begin_with_a_hash(tmp_path: Path) -> None:
    rows = '#1,W_B_W,95,passed,me,"wet\r\npassed,95\n"\n#2,W_B_W,95,stuck,me,\n'
    trials = read(tmp_path, "experiment,vehicle_type,width_mm,outcome,source,note\n" + rows)

    assert [(trial["experiment"], trial.get("note")) for trial in trials] == [("#1", "wet\npassed,95"), ("#2", None)]


def test_sheets_of_european_spreadsheets_are_read(tmp_path: Path) -> None:
    text = "\ufeffvehicle_type;width_mm;outcome;elapsed_time_s;source;note;;\r\nW_B_W;95,5;not passed;7,25;p;a, b;;\r\n"
    trial, other = read(tmp_path, text + "W_B_W;96.5;Off course;8;p;;;\r\n;;;;;;;\r\n")

    assert (trial["design"]["width_mm"], trial["elapsed_time_s"], trial["note"]) == (95.5, 7.25, "a, b")
    assert (other["design"]["width_mm"], trial["outcome"], other["outcome"]) == (96.5, "not_passed", "off_course")
