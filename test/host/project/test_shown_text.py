"""Texts from files and cars on the terminal: they steer nothing, and a locale shows them as far as it has letters."""

import csv
import io
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from conftest import two_widths
from foldcar.shown_text import markdown_text, shown, spreadsheet_cell, without_apostrophe
from foldcar.store.reader import Store
from forked_foldcar import original
from test_command_line import COMMAND

# Escape sequences, one of them C1's, and a mark that turns the line around: none may reach a terminal.
STEERING = "\x1b[31mX\u202eab\x9b2J[/b][red]"
ASCII = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
WRITTEN_OUT = "\\x1b[31mX\\u202eab\\x9b2J[/b][red]"
STEERING_LISTING = f"{STEERING.partition('/')[0]}.json"


@pytest.fixture(scope="module")
def steered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a listing of steering names, swept and with a trial, in s.db."""
    folder = tmp_path_factory.mktemp("steered")
    names = {section: {STEERING: content["1"]} for section, content in two_widths().items()}
    names["experiments"][STEERING] |= {"veh_id": STEERING, "env_id": STEERING}
    (folder / STEERING_LISTING).write_text(json.dumps(names), encoding="utf-8")
    row = f"{STEERING},W_B_W,95,passed,me{STEERING},note{STEERING}"
    (folder / "t.csv").write_text(f"experiment,vehicle_type,width_mm,outcome,source,note\n{row}\n")
    for words in (("sweep", STEERING_LISTING, "--store", "s.db", "--jobs", "1"), ("trials", "import", "s.db", "t.csv")):
        assert original().run(words, folder).returncode == 0
    return folder


@pytest.fixture
def steering(steered: Path, tmp_path: Path) -> str:
    """The name of that listing, in the test's folder."""
    shutil.copytree(steered, tmp_path, dirs_exist_ok=True)
    return STEERING_LISTING


def test_names_and_notes_do_not_steer_the_terminal(foldcar: Any, steering: str) -> None:
    run = ("run", steering, "--experiment")
    answers = [
        foldcar(*run, STEERING, "--set", "width=95"),
        foldcar(*run, f"{STEERING}x", "--set", "width=95"),
        foldcar(*run, STEERING, "--set", f"{STEERING}=95"),
        foldcar("trials", "list", "s.db"),
        foldcar("trials", "correct", "s.db", "1", "--note", "x", "--reason", STEERING),
        foldcar("report", "s.db", "-o", "page"),
        foldcar("log", steering, "--experiment", STEERING, "--port", STEERING),
        foldcar("sweep", f"{STEERING}.json", "--store", "s.db"),
    ]

    assert [answer.returncode for answer in answers] == [0, 2, 2, 0, 0, 0, 2, 2]
    for answer in answers:
        text = answer.stdout + answer.stderr
        assert "X\\u202eab\\x9b2J[" in text, answer.args
        assert not {"\x1b", "\u202e", "\x9b"} & set(text), answer.args


def test_a_table_on_a_terminal_has_rich_sequences_and_no_others(steering: str, tmp_path: Path) -> None:
    master, terminal = os.openpty()
    environment = {**os.environ, "COLUMNS": "400", "TERM": "xterm-256color"}
    process = original().start(["trials", "list", "s.db"], tmp_path, environment, [terminal] * 3)
    os.close(terminal)
    shown = b""
    while b"1 trial\r\n" not in shown:
        shown += os.read(master, 4096)

    assert process.wait(30) == 0
    os.close(master)
    assert "\x1b[1m" in shown.decode() and WRITTEN_OUT in shown.decode()
    assert "\x1b[31mX" not in shown.decode() and "\u202e" not in shown.decode()


def test_data_and_json_keep_names_as_they_are(foldcar: Any, steering: str, tmp_path: Path) -> None:
    environment = {**os.environ, **ASCII}
    command = [*COMMAND, "export", "s.db", "--csv", "-"]

    table = subprocess.run(command, capture_output=True, check=True, env=environment, cwd=tmp_path).stdout
    trials = foldcar("trials", "list", "s.db", "--json").stdout

    assert STEERING in table.decode("utf-8")
    assert trials.isascii() and json.loads(trials)["trials"][0]["note"] == f"note{STEERING}"


def test_an_ascii_locale_shows_what_it_has_no_letters_for(steering: str, tmp_path: Path) -> None:
    (tmp_path / steering).rename(tmp_path / "étude.json")
    environment = {**os.environ, **ASCII}

    def run(*words: str) -> "subprocess.CompletedProcess[bytes]":
        return subprocess.run([*COMMAND, *words], cwd=tmp_path, capture_output=True, env=environment)

    compared, swept = run("compare", "s.db"), run("sweep", "étude.json", "--store", "e.db")

    assert compared.returncode == 0 and b"\\u2013" in compared.stdout, compared.stderr
    assert swept.returncode == 0, swept.stderr
    with Store.open(tmp_path / "e.db") as store:
        assert "étude.json" in store.info().command


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("é – 宽\tx\n", "é – 宽\tx\n"),
        ("a\rb\x85\u2028\u2066", "a\\rb\\x85\\u2028\\u2066"),
        (os.fsdecode(b"\xe4"), "\\xe4"),
        # A name of UTF-8 under a locale of ASCII, with a mark of direction.
        ("\udcc3\udca9\udce2\udc80\udcae", "é\\u202e"),
        ("\ud800", "\\ud800"),
    ],
)
def test_shown_text_keeps_letters_and_writes_out_what_steers(text: str, written: str) -> None:
    assert shown(text) == written


@pytest.mark.parametrize("cell", ["=1+1", "@SUM(A1)", "+1+1", "-1+1", "-cmd|' /C calc'!A0", "\t=1", "\n-x", "+"])
def test_what_a_spreadsheet_would_run_begins_with_an_apostrophe(cell: str) -> None:
    assert spreadsheet_cell(cell) == f"'{cell}"


@pytest.mark.parametrize("cell", ["=1", "'=1", "''-x", "'", "'-1", "'a'", "-1", " =1"])
def test_a_text_comes_back_from_its_cell_with_all_its_apostrophes(cell: str) -> None:
    assert without_apostrophe(spreadsheet_cell(cell)) == cell


@pytest.mark.parametrize("cell", ["-1", "+2.5e-3", "-.5", "-inf", "a=1", "", "-1.", None, -1.5, True])
def test_other_cells_stay_as_they_are(cell: object) -> None:
    assert spreadsheet_cell(cell) is cell


@pytest.mark.parametrize("text", ["a\rb", "a\r\nb", "\r", "=1\r2"])
def test_a_carriage_return_ends_no_row(text: str) -> None:
    rows = io.StringIO(newline="")
    csv.writer(rows, lineterminator="\n").writerow([spreadsheet_cell(text), "x"])

    ((cell, after),) = csv.reader(io.StringIO(rows.getvalue(), newline=""))
    assert (without_apostrophe(cell), after) == ("\n".join(text.splitlines()) or "\n", "x")


def test_exported_texts_of_users_are_no_formulas(tmp_path: Path, foldcar: Any) -> None:
    row = "=1+1,W_B_W,95,passed,@me,-1+2,+x"
    (tmp_path / "t.csv").write_text(f"experiment,vehicle_type,width_mm,outcome,source,note,operator\n{row}\n")
    assert foldcar("trials", "import", "s.db", "t.csv").returncode == 0
    assert foldcar("export", "s.db", "--trials", "out.csv").returncode == 0

    (exported,) = csv.DictReader((tmp_path / "out.csv").open(newline=""))
    cells = [exported[name] for name in ("experiment", "source", "note", "operator", "width_mm")]
    assert cells == ["'=1+1", "'@me", "'-1+2", "'+x", "95.0"]


def test_names_are_no_markdown() -> None:
    name = "a|b *c* _d_ W_B_W [e](f) <g> `h`\n# i \\"
    assert markdown_text(name) == r"a\|b \*c\* \_d\_ W_B_W \[e\](f) \<g\> \`h\` \# i \\"
