"""The page of a store with markup and scripts in its names: they are shown as text, and none of them runs."""

import json
import sqlite3
from pathlib import Path

import pytest

from browser import Tab
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

KERB = STEP_PYRAMIDS.with_name("kerb.scenic")

# What ends an attribute, an element or a line, what charts replace in labels, and scripts in each place that runs them.
HOSTILE = (
    '<img src=x onerror="errors.push(1)">\n</script><script>errors.push(2)</script>{b}${errors.push(3)}'
    "\"'&<svg onload=errors.push(4)><a href=javascript:errors.push(5)>"
)
# Points at every mark of every chart and at places between them; collects what the tooltips say.
POINT_EVERYWHERE = """(async () => {
  const pause = time => new Promise(go => setTimeout(go, time)), tips = new Set();
  for (const details of document.querySelectorAll("details")) details.open = true;
  for (const chart of document.querySelectorAll(".chart")) {
    chart.scrollIntoView({ block: "center" });
    dispatchEvent(new Event("scroll"));
    await pause(50);
    const target = chart.querySelector("svg, canvas"), { left, top, width, height } = chart.getBoundingClientRect();
    const marks = [...chart.querySelectorAll("svg path")].map(mark => mark.getBoundingClientRect());
    const places = marks.filter(mark => mark.width < 30).map(mark => [mark.x + mark.width / 2, mark.y + mark.height / 2]);
    for (let x = 0.06; x < 1; x += 0.06) places.push([left + x * width, top + 0.4 * height]);
    for (const [clientX, clientY] of places) {
      target.dispatchEvent(new MouseEvent("mousemove", { bubbles: true, view: window, clientX, clientY }));
      await pause(20);
      const tip = [...chart.querySelectorAll(":scope > div")].find(part => part.style.pointerEvents === "none");
      if (tip?.textContent) tips.add(`${chart.closest("main > section").id}: ${tip.textContent}`);
    }
  }
  const made = document.querySelectorAll("main img, main svg[onload], main a[href^=javascript], main script").length;
  return { tips: [...tips], made, shown: document.querySelector("main").textContent, title: document.title, errors };
})()"""
# Puts markup into the page, as a fault of its own script would.
INSERT_SCRIPTS = """(async () => {
  window.ran = [];
  document.body.insertAdjacentHTML("beforeend",
    "<img src=x onerror='ran.push(1)'><iframe srcdoc='<script>top.ran.push(2)</script>'>");
  const script = document.createElement("script");
  script.textContent = "ran.push(3)";
  document.body.append(script);
  await new Promise(go => setTimeout(go, 500));
  return { ran, refused: errors };
})()"""


def test_names_of_a_store_are_shown_as_text_and_never_run(
    tmp_path: Path, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write, "_save_figures", lambda *_: None)
    cars = {"width": [80, 95, 245], "radius": [45, 60]}
    (tmp_path / "l.json").write_text(json.dumps(listing_of(KERB, cars, timeout=20, environments=30)))
    foldcar("sweep", tmp_path / "l.json", "--store", tmp_path / "s.db", "--realities", "0")
    (tmp_path / "t.csv").write_text("vehicle_type,outcome,source,width_mm,radius_mm\nW_B_W,passed,notes,95,60\n")
    foldcar("trials", "import", tmp_path / "s.db", tmp_path / "t.csv", "--experiment", "1")
    with sqlite3.connect(tmp_path / "s.db") as connection:
        (facts,) = connection.execute("SELECT facts FROM experiment").fetchone()
        objects = json.loads(facts)["terrain_objects"]
        hostile = {**json.loads(facts), "terrain_objects": [[f"{HOSTILE}{k}", n] for k, (_, n) in enumerate(objects)]}
        connection.execute("UPDATE experiment SET facts = ?", [json.dumps(hostile)])
        for sample, text in connection.execute("SELECT sample, objects FROM sample").fetchall():
            renamed = [
                [f"{HOSTILE}{k}", {f"{HOSTILE}_{key}": value for key, value in parameters.items()}]
                for k, (_, parameters) in enumerate(json.loads(text))
            ]
            connection.execute("UPDATE sample SET objects = ? WHERE sample = ?", [json.dumps(renamed), sample])
        connection.execute("UPDATE trial SET note = ?1, car_name = ?1, operator = ?1", [HOSTILE])
    foldcar("report", tmp_path / "s.db", "-o", tmp_path / "report")

    with Tab((tmp_path / "report" / "index.html").as_uri() + "#r.servo_torque=0.8") as tab:
        tab.wait("document.getElementById('whatif')?.dataset.done")
        page = tab.ask(POINT_EVERYWHERE)
        refused = tab.ask(INSERT_SCRIPTS)

    assert page["errors"] == [] and page["made"] == 0
    assert page["shown"].count(HOSTILE) > 4
    assert {tip.partition(":")[0] for tip in page["tips"]} == {"belief", "whatif", "parameters", "runs"}
    assert any(HOSTILE in tip for tip in page["tips"])
    assert refused["ran"] == [] and any(text.startswith("refused: script-src") for text in refused["refused"])
