"""The study page in a browser, from a file without a network: a real study, its counts, filters, address and replay."""

import json
import re
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy
import pytest

from browser import Tab, page_findings, study_of
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar, reported

WIDTHS, SAMPLES = (80, 95, 245), 4


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The folder of a swept store, s.db, with two trials, and of its report."""
    return reported(tmp_path_factory.mktemp("page"), WIDTHS, SAMPLES)


def stored(study: Path) -> list[tuple[int, int, str]]:
    """Design, environment and outcome of every run, as the store has them."""
    query = "SELECT design_position, sample, outcome FROM result ORDER BY 1, 2"
    return sqlite3.connect(study / "s.db").execute(query).fetchall()


def test_the_page_is_one_small_file_with_every_run_as_stored(study: Path) -> None:
    page = (study / "report" / "index.html").read_text()
    (experiment,) = study_of(study / "report")["experiments"]

    columns = [experiment["runs"][name] for name in ("design", "environment", "outcome")]
    shown = [(design, sample, experiment["outcomes"][outcome]) for design, sample, outcome in zip(*columns, strict=True)]
    assert shown == stored(study) and len(shown) == len(WIDTHS) * SAMPLES
    assert page_findings(re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)) == []
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=|@import", page.partition("<script")[0])
    assert len(page) < 3e6
    for _, address in experiment["files"]:
        assert (study / "report" / address).read_text().startswith("<?xml")


def test_figures_of_an_earlier_report_are_named(study: Path, tmp_path: Path) -> None:
    shutil.copytree(study, tmp_path, dirs_exist_ok=True)
    (tmp_path / "report" / "experiment_old_map.svg").touch()
    (tmp_path / "report" / "photo.png").touch()

    output = foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    assert [line for line in output.splitlines() if "not of this report" in line] == [
        f"{tmp_path / 'report'}: not of this report: experiment_old_map.svg"
    ]


WIDE = 1280


def probed(study: Path, script: str, fragment: str = "", width: int = WIDE) -> Any:
    """What the script puts into ``found``, of the page opened at ``fragment`` in a window of that width."""
    with Tab(f"{(study / 'report' / 'index.html').as_uri()}#{fragment}", width) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        answer = tab.ask(f"""(async () => {{
          const pause = time => new Promise(go => setTimeout(go, time));
          const one = (css, of = document) => of.querySelector(css), found = {{}};
          await pause(200);
          {script}
          return {{ ...found, width: document.documentElement.scrollWidth, errors }};
        }})()""")
    assert answer.pop("errors") == []
    return answer


# Without a screen Chromium tells of no scrolling.
LOOK = """
  for (const figure of document.querySelectorAll("[data-chart]")) {
    figure.scrollIntoView();
    dispatchEvent(new Event("scroll"));
    await pause(50);
  }
  const charts = [...document.querySelectorAll("[data-chart]")];
  found.charts = charts.map(figure => [figure.dataset.chart, !!one(".chart svg, .chart canvas", figure)]);
  found.clipped = [...document.querySelectorAll("svg text")].filter(text => {
    const box = text.getBoundingClientRect(), edge = text.ownerSVGElement.getBoundingClientRect();
    return box.width && (box.left < edge.left - 1 || box.right > edge.right + 1);
  }).map(text => text.textContent);
  const named = control => control.ariaLabel || control.textContent.trim() || control.closest("label");
  const controls = [...document.querySelectorAll("button, select, input")];
  found.unnamed = controls.filter(control => !named(control)).map(control => control.outerHTML.slice(0, 80));
  found.unlabelled = [...document.querySelectorAll(".chart")].filter(chart => !chart.ariaLabel).length;
  found.height = document.documentElement.scrollHeight;
"""


FILTER = """
  const lists = () => one("#listed summary").textContent;
  found.all = lists();
  found.ended = one("#ends p").textContent;
  const least = one("input[data-key=width_mm][data-end='0']");
  least.closest("details").open = true;
  least.value = 90; least.dispatchEvent(new Event("change")); await pause(50);
  found.kept = one(".kept").textContent;
  found.wide = lists();
  const chip = one("#endings [data-outcome=passed]");
  chip.click(); await pause(50);
  found.pressed = one("#endings [data-outcome=passed]").getAttribute("aria-pressed");
  found.passed = lists();
  found.passedEnds = one("#ends").hidden;
  one("#listed details").open = true; await pause(50);
  found.rows = [...document.querySelectorAll("#listed tbody tr")].map(row => row.textContent);
  const behind = one("[data-chart=curve] details"); behind.open = true; await pause(50);
  found.table = [...behind.querySelectorAll("tbody tr")].map(row => [...row.children].map(cell => cell.textContent));
  await pause(600); found.filtered = location.hash;
  study.set({ brushes: {}, outcomes: [] }); await pause(50);
"""
DRAG = """
  const chart = one("[data-chart=parallel] .chart");
  chart.scrollIntoView({ block: "center" }); dispatchEvent(new Event("scroll")); await pause(100);
  const name = [...chart.querySelectorAll("text")].find(text => text.textContent.startsWith("width"));
  const axis = name.getBoundingClientRect();
  const area = chart.getBoundingClientRect(), x = axis.left + axis.width / 2, target = one("svg", chart);
  const send = (type, y, buttons) => target.dispatchEvent(new MouseEvent(type, {
    bubbles: true, view: window, clientX: x, clientY: y, button: 0, buttons }));
  send("mousemove", area.top + 60, 0); send("mousedown", area.top + 60, 1);
  for (let y = 60; y <= 120; y += 10) { send("mousemove", area.top + y, 1); await pause(20); }
  send("mouseup", area.top + 120, 0); await pause(100);
  found.brush = study.state.brushes.width_mm;
  found.dragged = one(".kept").textContent;
  study.set({ brushes: {} }); await pause(50);
"""
KEYS = """
  const grid = one("[data-chart=grid] .chart");
  grid.focus();
  const press = async key => {
    grid.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
    await pause(100);
  };
  await press("ArrowRight");
  found.first = one("#grid .told").textContent;
  await press("ArrowRight"); await press("ArrowUp"); await pause(1500);
  found.second = one("#grid .told").textContent;
  found.keyed = location.hash;
  found.panel = one("#design h3").textContent;
  found.end = Number(one("#replay").dataset.end);
"""


@pytest.fixture(scope="module")
def used(study: Path) -> Any:
    """What the page in a wide window tells while a person filters, drags and presses keys."""
    return probed(study, LOOK + FILTER + DRAG + KEYS)


def test_every_chart_is_drawn_and_fits_and_every_control_has_a_name(study: Path, used: Any) -> None:
    for width, probe in ((WIDE, used), (390, probed(study, LOOK, width=390))):
        assert probe["charts"] == [[name, True] for name in ("curve", "parallel", "scatter", "ends", "grid")]
        assert probe["clipped"] == probe["unnamed"] == [] and probe["unlabelled"] == 0
        assert probe["width"] <= width
    # Five screens, but on a telephone.
    assert used["height"] <= 5 * 900


def test_filters_keep_what_they_say_and_stand_in_the_address(study: Path, used: Any) -> None:
    runs = stored(study)
    wide = [run for run in runs if WIDTHS[run[0]] >= 90]
    passed = [run for run in wide if run[2] == "passed"]

    assert 0 < len(passed) < len(wide) < len(runs)
    assert used["all"].startswith(f"{len(runs)} runs") and used["wide"].startswith(f"{len(wide)} runs")
    assert used["passed"].startswith(f"{len(passed)} runs") and used["pressed"] == "true"
    listed = [f"{WIDTHS[design]} mm, environment {sample}" for design, sample, _ in passed]
    assert [row.split("passed")[0] for row in used["rows"]] == listed
    assert "2 of 3 designs" in used["kept"]
    counts = [f"{sum(run[0] == d and run[2] == 'passed' for run in runs)} of {SAMPLES}" for d in range(len(WIDTHS))]
    assert [row[3] for row in used["table"]] == counts
    assert "b.width_mm=90..245" in used["filtered"] and "outcome=passed" in used["filtered"]


def test_a_sentence_says_at_which_obstacle_runs_fail(study: Path, used: Any) -> None:
    failed = [run for run in stored(study) if run[2] != "passed"]

    assert re.fullmatch(rf"\d+ % of the {len(failed)} failures end at (near|far).*", used["ended"])
    assert used["passedEnds"]


def test_a_brush_along_an_axis_keeps_its_designs(used: Any) -> None:
    ((low, high),) = used["brush"]
    assert WIDTHS[0] < low < high <= WIDTHS[-1]
    kept = sum(low <= width <= high for width in WIDTHS)
    assert used["dragged"].startswith(f"{kept} of 3 designs: width ")


def test_arrow_keys_go_from_run_to_run_which_are_replayed(study: Path, used: Any) -> None:
    outcomes = {(design, sample): outcome for design, sample, outcome in stored(study)}
    (end_s,) = (
        sqlite3.connect(study / "s.db")
        .execute("SELECT elapsed_time_s FROM result WHERE design_position = 1 AND sample = 1")
        .fetchone()
    )

    assert used["first"].startswith("80 mm, environment 0: ")
    words = {"passed": "passed", "tipped": "tipped over", "stuck": "stuck", "off_course": "off course"}
    assert used["second"].startswith(f"95 mm, environment 1: {words[outcomes[1, 1]]} after ")
    assert "design=95+mm" in used["keyed"] and "env=1" in used["keyed"]
    assert used["panel"].startswith("95 mm")
    assert used["end"] == pytest.approx(end_s)


OPENED = """
  await pause(1500);
  found.t = Number(one("#replay").dataset.t);
  found.told = one("#grid .told").textContent;
  found.top = Math.round(one("#runs").getBoundingClientRect().top);
  found.listed = one("#listed summary").textContent;
"""


def test_an_address_opens_the_run_at_its_time_with_its_filters_and_scrolls_there(study: Path) -> None:
    probe = probed(study, OPENED, "design=95+mm&env=2&t=0.75&at=runs&b.width_mm=90..245&outcome=passed")

    assert probe["t"] == 0.75
    assert probe["told"].startswith("95 mm, environment 2: ")
    # Under the bar that stays at the top, or as far up as the end of the page allows.
    assert 0 <= probe["top"] < 450
    passed = sum(run[0] == 1 and run[2] == "passed" for run in stored(study))
    assert probe["listed"].startswith(f"{passed} runs of 95 mm")


def test_two_engines_have_a_sentence_and_a_curve_each(tmp_path: Path, carsim_binary: Path) -> None:
    listing = listing_of(STEP_PYRAMIDS, {"width": list(WIDTHS)}, timeout=120, environments=SAMPLES)
    (tmp_path / "l.json").write_text(json.dumps(listing))
    for engine in ("multibody", "side-view"):
        foldcar("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db", "--engine", engine)
    foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    first, second = study_of(tmp_path / "report")["experiments"]
    for experiment, other in ((first, second), (second, first)):
        (engine,) = experiment["engines"]
        assert engine["id"] == other["id"]
        assert [engine[name] for name in ("passed", "runs")] == [other["designs"][name] for name in ("passed", "runs")]
        assert engine["text"] in experiment["remarks"]
    outcomes = [numpy.array(experiment["runs"]["outcome"]) == 0 for experiment in (first, second)]
    counts = [int(passed.sum()) for passed in outcomes]
    alike = 100 * numpy.mean(outcomes[0] == outcomes[1])
    assert first["engines"][0]["text"] == (
        f"side-view: {counts[1]} of the same 12 runs passed, multibody: {counts[0]}; "
        f"{alike:.1f} % of the runs have the same result in both."
    )
    probe = probed(tmp_path, 'found.legend = one("[data-chart=curve]").previousSibling.textContent;' + SERIES)
    assert "side-view" in probe["legend"]
    assert probe["dashed"] == 1


def test_simulations_are_compared_only_if_they_drive_alike_and_are_named_by_all_that_differs(
    tmp_path: Path, carsim_binary: Path
) -> None:
    listing = listing_of(STEP_PYRAMIDS, {"width": list(WIDTHS)}, timeout=120, environments=SAMPLES)
    (tmp_path / "l.json").write_text(json.dumps(listing))
    (tmp_path / "high.json").write_text('{"obstacle_height": 1.3}')

    def sweep_and_report(*options: str) -> list[list[str]]:
        """The texts of each experiment on the other simulations, after another sweep."""
        foldcar("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db", "--realities", "0", *options)
        foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")
        experiments = study_of(tmp_path / "report")["experiments"]
        return [[engine["name"] for engine in experiment["engines"]] for experiment in experiments]

    assert sweep_and_report() == [[]]
    assert sweep_and_report("--engine", "side-view") == [["side-view"], ["multibody"]]
    nominal, side_view, high = sweep_and_report("--reality", str(tmp_path / "high.json"))
    assert nominal[0] == "side-view" and nominal[1].startswith("reality high")
    assert side_view[0] == "multibody" and side_view[1].startswith("multibody (reality high")
    assert high == ["nominal", "side-view (nominal)"]
    # The runs of another time limit are other runs.
    (experiment,) = listing["experiments"].values()
    experiment["params"]["timeout"] = 60
    (tmp_path / "l.json").write_text(json.dumps(listing))
    assert sweep_and_report() == [[], side_view[1:], ["side-view (nominal)"]]


SERIES = """
  found.dashed = document.querySelectorAll("[data-chart=curve] svg path[stroke-dasharray][stroke-width='1.5']").length;
"""
