"""The page's table of designs: its order by every column, filter, hidden columns and keyboard, beside the store."""

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from browser import Tab
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

WIDTHS, RADII, SAMPLES = (80, 95, 245), (45, 60), 6
# In the order of the store.
DESIGNS = [(width, radius) for width in WIDTHS for radius in RADII]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The folder of a swept store, s.db, with two trials of 95 mm, radius 60 mm, and of its report."""
    folder = tmp_path_factory.mktemp("table")
    cars = {"width": list(WIDTHS), "radius": list(RADII)}
    (folder / "l.json").write_text(json.dumps(listing_of(STEP_PYRAMIDS, cars, timeout=40, environments=SAMPLES)))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--realities", "0")
    rows = ("vehicle_type,outcome,source,width_mm,radius_mm", *("W_B_W,passed,notes,95,60",) * 2, "")
    (folder / "t.csv").write_text("\n".join(rows))
    foldcar("trials", "import", folder / "s.db", folder / "t.csv", "--experiment", "1")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_save_figures", lambda *_: None)
        foldcar("report", folder / "s.db", "-o", folder / "report")
    return folder


def passed_runs(study: Path) -> list[int]:
    """How many runs of each design passed, as the store has them."""
    query = "SELECT design_position, SUM(outcome = 'passed') FROM result GROUP BY 1 ORDER BY 1"
    return [passed for _, passed in sqlite3.connect(study / "s.db").execute(query)]


PAGE = """
  const table = document.querySelector("#design-table"), [filter, columns] = [table.querySelector("input[type=search]"),
    () => [...table.querySelectorAll("thead button")]];
  const rows = () => [...table.querySelectorAll("tbody tr th")].map(cell => cell.textContent);
  const cells = name => {
    const at = columns().findIndex(button => button.textContent === name);
    return [...table.querySelectorAll("details .designs tbody tr")].map(row => row.children[at].textContent);
  };
  const heading = name => columns().find(button => button.textContent === name);
  const press = name => { heading(name).focus(); heading(name).click(); };
  const sorts = () => columns().filter(button => button.parentElement.ariaSort !== "none").map(
    button => [button.textContent, button.parentElement.ariaSort]);
  const type = text => { filter.value = text; filter.dispatchEvent(new Event("input")); };
  const said = () => table.querySelector("[role=status]").textContent;
  const summary = () => table.querySelector("summary").textContent;
  table.querySelector("details").open = true;
  await new Promise(go => setTimeout(go, 100));
"""


def asked(study: Path, script: str, width: int = 1280) -> Any:
    """What the script returns on the opened page."""
    with Tab((study / "report" / "index.html").as_uri(), width) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        answer = tab.ask(f"(async () => {{ {PAGE} {script} }})()")
        assert tab.ask("errors") == []
    return answer


def test_every_column_sorts_both_ways_with_the_numbers_of_the_store(study: Path) -> None:
    passed = passed_runs(study)
    found = asked(
        study,
        """const found = {};
        for (const name of columns().map(button => button.textContent)) {
          press(name); const first = [sorts(), cells(name), document.activeElement.textContent];
          press(name); found[name] = [first, [sorts(), cells(name), document.activeElement.textContent]];
        }
        return found;""",
    )

    assert list(found) == [
        "design", "width (mm)", "radius (mm)", "passed in simulation", "trials passed", "time, failures at the limit (s)",
        "time of passing runs (s)", "energy per pass (J)", "mass (g)", "sheet area (cm²)",
    ]  # fmt: skip
    for name, states in found.items():
        first = "descending" if name in ("passed in simulation", "trials passed") else "ascending"
        other = "ascending" if first == "descending" else "descending"
        for (sorts, cells, focused), order in zip(states, (first, other), strict=True):
            assert sorts == [[name, order]] and focused == name and len(cells) == len(DESIGNS)
            if name == "design" or name == "trials passed":
                continue
            known = [float(cell.split(" of ")[0]) for cell in cells if cell != "–"]
            assert known == sorted(known, reverse=order == "descending") and len(set(known)) > 1
            assert all(cell == "–" for cell in cells[len(known) :])
    assert found["passed in simulation"][0][1] == [f"{count} of {SAMPLES}" for count in sorted(passed, reverse=True)]
    assert found["trials passed"][0][1] == ["2 of 2", *["–"] * 5]
    by_name = [f"width {width} mm, radius {radius} mm" for width, radius in DESIGNS]
    # 80 before 245: numbers in names count as numbers.
    assert found["design"][0][1] == by_name and found["design"][1][1] == by_name[::-1]


def test_a_filter_keeps_words_and_limits_and_names_what_it_cannot_read(study: Path) -> None:
    passed = passed_runs(study)
    texts = ["", "radius 60", "width>80", "width >= 95 RADIUS<60", "simulated>=50", "trials=2", "w=80"]
    texts += ["weight>3 95", "width>x"]
    found = asked(
        study,
        f"""return {json.dumps(texts)}.map(text => {{
          type(text); const widths = cells("width (mm)"), radii = cells("radius (mm)");
          return [widths.map((width, k) => [Number(width), Number(radii[k])]), said(), summary()];
        }});""",
    )

    kept = {text: [tuple(design) for design in designs] for text, (designs, _, _) in zip(texts, found, strict=True)}
    assert kept[""] == DESIGNS and found[0][1:] == ["", "6 designs as a table"]
    assert kept["radius 60"] == [design for design in DESIGNS if design[1] == 60]
    assert kept["width>80"] == [design for design in DESIGNS if design[0] > 80]
    assert found[2][2].startswith("4 of 6 designs")
    assert kept["width >= 95 RADIUS<60"] == [(95, 45), (245, 45)]
    half = [design for design, count in zip(DESIGNS, passed, strict=True) if count / SAMPLES >= 0.5]
    assert kept["simulated>=50"] == half and 0 < len(half) < 6
    assert kept["trials=2"] == [(95, 60)]
    # A beginning that only one column has.
    assert kept["w=80"] == [(80, 45), (80, 60)]
    assert kept["weight>3 95"] == [(95, 45), (95, 60)]
    assert found[7][1].startswith("weight: no column has this name; there are width, radius, simulated, trials, time, ")
    assert kept["width>x"] == DESIGNS and found[8][1] == "width>x: x is not a number."


def test_columns_hide_and_ranges_of_the_page_hold_for_the_table(study: Path) -> None:
    found = asked(
        study,
        """const before = columns().length, box = [...table.querySelectorAll("[type=checkbox]")][0];
        box.click(); const hidden = columns().map(button => button.textContent);
        const row = table.querySelector("details .designs tbody tr").children.length;
        box.click(); const again = columns().length;
        study.brush("radius_mm", [[50, 60]]); press("width (mm)");
        return { before, hidden, row, again, radii: cells("radius (mm)"), widths: cells("width (mm)"), summary: summary(),
          wide: document.documentElement.scrollWidth };""",
        width=390,
    )

    assert found["before"] == found["again"] == 10 and found["row"] == len(found["hidden"]) == 9
    assert "width (mm)" not in found["hidden"]
    assert found["radii"] == ["60"] * 3 and found["widths"] == ["80", "95", "245"]
    assert found["summary"] == "3 of 6 designs as a table" and found["wide"] <= 390


def test_headings_are_reached_and_pressed_by_keys(study: Path) -> None:
    with Tab((study / "report" / "index.html").as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.ask("document.querySelector('#design-table details').open = true")
        tab.wait("document.querySelectorAll('#design-table thead button').length")
        tab.ask("document.querySelector('#design-table thead button').focus()")
        for key, code, text in (("Tab", 9, ""), ("Enter", 13, "\r")):
            pressed = {"key": key, "windowsVirtualKeyCode": code}
            tab.send("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **pressed)
            tab.send("Input.dispatchKeyEvent", type="keyUp", **pressed)
        sort = "document.querySelector('#design-table [aria-sort=ascending]')?.textContent"
        assert tab.wait(sort, seconds=10) == "width (mm)"
