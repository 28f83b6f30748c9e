"""The study page of two experiments: another one is chosen while charts are laid out and while simulators work."""

import json
from pathlib import Path

import pytest

from browser import Tab
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

ENVIRONMENTS = {"1": 12, "2": 8}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    folder = tmp_path_factory.mktemp("two")
    kerb, cars = STEP_PYRAMIDS.with_name("kerb.scenic"), {"width": [80, 95, 245], "radius": [45, 60]}
    listing = listing_of(kerb, cars, timeout=20)
    for name, count in ENVIRONMENTS.items():
        listing["experiments"][name] = {"veh_id": 1, "env_id": 1, "params": {"timeout": 20, "environments": count}}
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db")
    foldcar("report", folder / "s.db", "-o", folder / "report")
    return folder / "report" / "index.html"


CHOOSE = """
  const pause = time => new Promise(go => setTimeout(go, time));
  const choose = id => {
    const list = document.querySelector("#experiment select");
    list.value = id;
    list.dispatchEvent(new Event("change"));
  };
"""
WHILE_LAID_OUT = f"""(async () => {{
  {CHOOSE}
  for (const chart of document.querySelectorAll(".chart")) {{
    chart.scrollIntoView();
    dispatchEvent(new Event("scroll"));
    await pause(20);
  }}
  const drawn = document.querySelectorAll(".chart svg, .chart canvas").length;
  for (const [turn, id] of ["2", "1", "2"].entries()) {{
    document.querySelector("main").style.width = `${{900 - 40 * turn}}px`;
    // After this frame's observers and before the next frame, in which charts are drawn for their new width.
    await new Promise(requestAnimationFrame);
    await pause(0);
    choose(id);
    await pause(200);
  }}
  return drawn;
}})()"""
WHILE_SIMULATED = f"""(async () => {{
  {CHOOSE}
  study.study.experiments[1].drives = null;
  document.querySelector("#verify button").click();
  document.getElementById("marginals").click();
  const slider = document.querySelector('input[aria-label^="friction"]');
  slider.value = 0.7;
  slider.dispatchEvent(new Event("input"));
  await pause(250);
  choose("2");
  await pause(100);
  const hidden = ["verify", "whatif", "replay"].every(id => document.getElementById(id).hidden);
  choose("1");
  await pause(3000);
  return [hidden, document.getElementById("whatif-single").textContent];
}})()"""


def test_another_experiment_is_shown_although_charts_were_to_be_drawn(page: Path) -> None:
    with Tab(page.as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        drawn = tab.ask(WHILE_LAID_OUT)
        facts = tab.ask("document.getElementById('fixed').textContent")
        assert drawn > 6 and f"environments {ENVIRONMENTS['2']}" in facts and tab.ask("errors") == []


def test_another_experiment_is_shown_although_simulators_work_for_the_first(page: Path) -> None:
    with Tab(page.as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        hidden, single = tab.ask(WHILE_SIMULATED)
        status = tab.ask("document.querySelector('#verify [role=status]').textContent")
        assert hidden and single == status == "" and tab.ask("errors") == []
        # The experiment is as if it had never been left.
        tab.ask("document.querySelector('#verify button').click()")
        tab.wait("document.querySelector('#verify [role=status]').textContent.startsWith('✓ 72 of 72')")
