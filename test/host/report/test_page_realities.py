"""Realities on the study page: curves that set the sliders, what the trials have taught, faded maps."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy
import pytest

from browser import READY, Tab, study_of
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar, reported

THIN = "document.querySelectorAll(\"[data-chart=curve] svg path[stroke-width='0.9']\")"
THICK = "document.querySelectorAll(\"[data-chart=curve] svg path[stroke-width='3']\")"
OUTPUTS = "[...document.querySelectorAll('.slider input')].map(slider => Number(slider.value))"
LABELS = {
    "friction": "friction", "servo_torque": "servo torque", "servo_speed": "servo speed",
    "obstacle_height": "obstacle height", "com_height_m": "centre of mass, raised", "track_m": "track, widened",
    "start_position_sd_m": "start scatter, position", "start_heading_sd_rad": "start scatter, heading",
    "wheel_spread": "differences between wheels",
}  # fmt: skip


@pytest.fixture(autouse=True)
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write, "_save_figures", lambda *_: None)


def swept_folder(folder: Path, common: dict[str, Any], trials: str) -> Path:
    """A folder with the reports "before" and "after" trials of a study with runs in other realities."""
    listing = listing_of(STEP_PYRAMIDS, common, timeout=60, environments=20)
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--realities", "400")
    foldcar("report", folder / "s.db", "-o", folder / "before")
    shutil.copy(folder / "s.db", folder / "driven.db")
    (folder / "t.csv").write_text(trials)
    foldcar("trials", "import", folder / "driven.db", folder / "t.csv", "--experiment", "1")
    foldcar("trials", "measure", folder / "driven.db", "track_m=0.002")
    foldcar("report", folder / "driven.db", "-o", folder / "after")
    return folder


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """Three widths. In the trials, no car passes: obstacles are probably higher than simulated."""
    rows = ["vehicle_type,outcome,source,width_mm"]
    rows += [f"W_B_W,{outcome},notes,{width}" for width, outcome in ((80, "tipped"), (95, "tipped"), (245, "tipped"))] * 8
    return swept_folder(tmp_path_factory.mktemp("curves"), {"width": [80, 95, 245]}, "\n".join([*rows, ""]))


@pytest.fixture(scope="module")
def two_parameters(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """Two widths times two radii, with trials of one design."""
    rows = ["vehicle_type,outcome,source,width_mm,radius_mm", *["W_B_W,passed,notes,95,60"] * 6, ""]
    return swept_folder(tmp_path_factory.mktemp("map"), {"width": [95, 200], "radius": [45, 60]}, "\n".join(rows))


def opened(report: Path, fragment: str = "") -> Tab:
    return Tab(f"{(report / 'index.html').as_uri()}#{fragment}")


def experiment_of(report: Path) -> dict[str, Any]:
    (experiment,) = study_of(report)["experiments"]
    return dict(experiment)


def slider_values(experiment: dict[str, Any], reality: int) -> dict[str, float]:
    """The values that the sliders should have: those of the reality, within the sliders' limits."""
    realities = experiment["realities"]
    values = dict(zip(realities["names"], realities["values"][reality], strict=True))
    return {
        slider["name"]: min(slider["high"], max(slider["low"], values.get(slider["name"], slider["nominal"])))
        for slider in experiment["drives"]["sliders"]
    }


# Presses and releases the mouse on the curve with index 17, as a person does; always at the same place of the chart.
PRESS = """(() => {
  const svg = document.querySelector("[data-chart=curve] svg");
  svg.closest("figure").scrollIntoView({ block: "center" });
  window.place ??= (path => path.getPointAtLength(path.getTotalLength() / 4))(THIN[17]);
  const { left, top } = svg.getBoundingClientRect(), at = { clientX: left + place.x, clientY: top + place.y };
  for (const type of ["mousemove", "mousedown", "mouseup", "click"])
    svg.dispatchEvent(new MouseEvent(type, { bubbles: true, view: window, button: 0, ...at }));
})()""".replace("THIN", THIN)


def test_each_reality_has_a_curve_that_sets_the_sliders_when_it_is_pressed(study: Path) -> None:
    experiment = experiment_of(study / "before")
    rates = experiment["realities"]["rates"]
    with opened(study / "before") as tab:
        tab.wait(READY)
        curves = tab.ask(f"[...{THIN}].map(path => path.getAttribute('d'))")
        unchosen = tab.ask(f"[{THICK}.length, study.reality, document.getElementById('reality').innerText]")
        tab.ask(PRESS)
        chosen = tab.ask("study.reality")
        drawn = tab.ask(f"[...{THICK}].map(path => path.getAttribute('d'))")
        sliders, text = tab.ask(OUTPUTS), tab.ask("document.getElementById('reality').innerText")
        link = tab.ask("study.link.split('#')[1]")
        tab.wait("document.getElementById('whatif').dataset.done")
        tab.ask(PRESS)
        reset = tab.ask(f"[study.reality, study.state.reality, {THICK}.length]")
        errors = tab.ask("errors")

    assert len(curves) == len(rates) == 100 and unchosen[:2] == [0, None] and "chosen reality" not in unchosen[2]
    # Curves cross: the one on top where the mouse is takes the press.
    assert chosen is not None and drawn == [curves[chosen]]
    expected = slider_values(experiment, chosen)
    steps = [(slider["high"] - slider["low"]) / 200 for slider in experiment["drives"]["sliders"]]
    for value, wanted, step in zip(sliders, expected.values(), steps, strict=True):
        assert value == pytest.approx(wanted, abs=step)
    friction = dict(zip(experiment["realities"]["names"], experiment["realities"]["values"][chosen], strict=True))[
        "friction"
    ]
    assert f"The chosen reality: friction {friction:.3g} ×; servo torque " in text
    assert reset == [None, {}, 0] and errors == []
    # The address keeps the choice; another value of a slider ends it.
    with opened(study / "before", link) as tab:
        tab.wait(READY)
        assert tab.ask("study.reality") == chosen and tab.ask(f"{THICK}.length") == 1
        slider = "document.querySelector('.slider input')"
        tab.ask(f"{slider}.value = {slider}.max; {slider}.dispatchEvent(new Event('input'))")
        assert tab.ask("study.reality") is None and tab.ask(f"{THICK}.length") == 0


def test_buttons_go_from_reality_to_reality_by_their_success(study: Path) -> None:
    rates = numpy.array(experiment_of(study / "before")["realities"]["rates"]).mean(axis=1)
    press = "[...document.querySelectorAll('#reality button')].find(button => button.textContent.includes('{}')).click()"
    seen = []
    with opened(study / "before") as tab:
        tab.wait(READY)
        for name in ("better", "better", "worse", "worse"):
            tab.ask(press.format(name))
            seen.append(tab.ask("study.reality"))
        tab.ask(press.format("none"))
        assert tab.ask("study.reality") is None and tab.ask("study.state.reality") == {}
        # A page that cannot simulate has no sliders: the curve is drawn thick all the same.
        tab.ask("(study.e.sliders = [], study.chooseReality(3))")
        assert tab.ask("study.reality") == 3 and tab.ask(f"{THICK}.length") == 1
        assert "sliders" not in tab.ask("document.getElementById('reality').innerText") and tab.ask("errors") == []

    first, second, third, fourth = seen
    assert rates[fourth] <= rates[first] <= rates[second] and third == first


def test_a_value_beyond_its_slider_is_moved_into_it_with_a_remark(study: Path) -> None:
    with opened(study / "before") as tab:
        tab.wait(READY)
        tab.ask("(study.e.realities.values[7][0] = 50, study.chooseReality(7))")
        high = tab.ask("study.e.sliders[0].high")
        (remark,) = tab.ask("[...document.querySelectorAll('#link-remarks li')].map(item => item.textContent)")
        assert remark.startswith("The reality's friction, 50 ×, is outside the slider's limits, ")
        assert tab.ask("study.state.reality.friction") == high and tab.ask("study.reality") == 7


def test_before_a_trial_a_sentence_names_the_unknowns(study: Path) -> None:
    with opened(study / "before") as tab:
        tab.wait(READY)
        text, rows = (
            tab.ask("document.querySelector('#taught p').textContent"),
            tab.ask("!!document.querySelector('.unknown')"),
        )

    assert text.startswith("No trial counts yet. The simulator does not know friction; ")
    assert all(label in text for label in LABELS.values()) and not rows


# Of each row: its name, whether it is marked, and kind, left end and width (%) of each of its marks.
ROWS = """[...document.querySelectorAll(".unknown")].map(row => [row.querySelector(".name").textContent,
  row.classList.contains("taught"),
  [...row.querySelectorAll("i")].map(({ className, style: { left, width } }) =>
    [className, parseFloat(left), parseFloat(width)])])"""


def test_after_trials_each_unknown_is_shown_before_and_after(study: Path) -> None:
    realities = experiment_of(study / "after")["realities"]
    with opened(study / "after") as tab:
        tab.wait(READY)
        rows, sentences = (
            tab.ask(ROWS),
            tab.ask("[...document.querySelectorAll('#taught li')].map(item => item.textContent)"),
        )
        remarks = tab.ask("document.getElementById('remarks').textContent")

    assert realities["driven"] and any(unknown["taught"] for unknown in realities["unknowns"])
    assert sentences == realities["taught"] and not any(sentence in remarks for sentence in sentences)
    marked = [taught for _, taught, _ in rows]
    assert marked == sorted(marked, reverse=True) and len(rows) == len(LABELS)
    by_label = {LABELS[unknown["name"]]: unknown for unknown in realities["unknowns"]}
    for label, taught, marks in rows:
        unknown, places = by_label[label], {kind: (left, width) for kind, left, width in marks}
        assert taught == unknown["taught"] and ("measured" in places) == (unknown["measured"] is not None)
        (low, middle, high), (left, width) = unknown["before"], places["before"]

        def on_axis(
            value: float, low: float = low, high: float = high, left: float = left, width: float = width
        ) -> float:
            """The place of a value, by the ends of the bar "before"."""
            return left + width * (value - low) / (high - low)

        assert places["after"][0] == pytest.approx(on_axis(unknown["after"][0]), abs=0.01)
        assert sum(places["after"]) == pytest.approx(on_axis(unknown["after"][2]), abs=0.01)
        assert places["median before"][0] == pytest.approx(on_axis(middle), abs=0.01)
        if unknown["measured"] is not None:
            assert label == "track, widened" and places["measured"][0] == pytest.approx(on_axis(0.002), abs=0.01)


def test_sliders_show_what_is_known_before_and_after_the_trials(study: Path) -> None:
    bars = """[...document.querySelectorAll(".slider")].map(slider => [...slider.querySelectorAll(".marks i")].map(mark =>
      [mark.className, parseFloat(mark.style.left), parseFloat(mark.style.width)]))"""
    for name, kinds in (("before", ["before"]), ("after", ["before", "after"])):
        experiment = experiment_of(study / name)
        unknowns = {unknown["name"]: unknown for unknown in experiment["realities"]["unknowns"]}
        with opened(study / name) as tab:
            tab.wait(READY)
            shown = tab.ask(bars)
        for slider, marks in zip(experiment["drives"]["sliders"], shown, strict=True):
            known = unknowns.get(slider["name"])
            assert [kind for kind, *_ in marks] == ([*kinds, "nominal"] if known else ["nominal"])
            for kind, left, width in marks[:-1]:
                assert known is not None
                low, _, high = (min(slider["high"], max(slider["low"], value)) for value in known[kind])
                span = slider["high"] - slider["low"]
                assert (left, width) == pytest.approx(
                    (100 * (low - slider["low"]) / span, 100 * (high - low) / span), abs=0.01
                )


CELLS = """[...document.querySelectorAll("[data-chart=map] svg path")].map(path => path.getAttribute("fill"))
  .filter(fill => /^rgb/.test(fill))"""


def test_a_map_is_a_guess_until_a_car_was_driven_and_pale_where_little_is_known(two_parameters: Path) -> None:
    title = "document.querySelector('[data-chart=map]').parentElement.querySelector('h3').textContent"
    with opened(two_parameters / "after") as tab:
        tab.wait(READY)
        assert tab.ask(title) == "Success of built cars, by design"
    with opened(two_parameters / "before") as tab:
        tab.wait(READY)
        assert tab.ask(title) == "A guess from simulation: success of built cars, by design"
        # The same rate, and the interval is narrow for one design and wide for another.
        tab.ask("""Object.assign(study.e.designs, { belief: [0.99, 0.99, 0.5, 0.5], belief_low: [0.98, 0.07, 0.5, 0.5],
          belief_high: [1, 1, 0.5, 0.5] })""")
        tab.ask("study.notify('data')")
        cells = tab.wait(f"{CELLS}.length && {CELLS}")
        errors = tab.ask("errors")

    parts = [[int(part) for part in cell[4:-1].split(",")] for cell in cells]
    assert len(cells) == 4 and errors == []
    # A dark green, and nearly the white of the page.
    assert max(parts[0][0], parts[0][2]) < 100 and min(parts[1]) > 225


def test_two_lines_at_the_top_say_what_to_take_and_what_to_do(study: Path) -> None:
    experiment = experiment_of(study / "after")
    with opened(study / "after") as tab:
        tab.wait(READY)
        lines = tab.ask(
            "[...document.querySelectorAll('.lead')].map(line => [line.querySelector('b').textContent, line.textContent])"
        )
        headings = tab.ask(
            "[...document.querySelectorAll('#summary h1, #summary h2')].map(heading => heading.textContent)"
        )
        steps = tab.ask("[...document.querySelectorAll('#steps li')].map(item => item.textContent)")

    assert lines == [
        ["Want a car that works?", experiment["headline"]], ["Want to learn most?", experiment["next"]["text"]],
    ]  # fmt: skip
    assert headings == [study_of(study / "after")["title"]]
    weighed = experiment["next"]["steps"]
    shown = [f"{step['text']} (+{100 * step['gain']:.1f} points, {step['minutes']} min)" for step in weighed]
    assert steps == (shown if len(shown) > 1 else [])


def test_without_realities_the_page_speaks_of_simulation_and_trials_only(tmp_path: Path, carsim_binary: Path) -> None:
    reported(tmp_path, (80, 95), 4)
    experiment = experiment_of(tmp_path / "report")
    assert experiment["realities"] is None
    with opened(tmp_path / "report") as tab:
        tab.wait(READY)
        note = tab.ask("document.getElementById('belief-note').textContent")
        legend = tab.ask("document.querySelector('#belief-charts .legend').textContent")
        hidden, curves = tab.ask("document.getElementById('taught').hidden"), tab.ask(f"{THIN}.length")
        bars, errors = tab.ask("document.querySelectorAll('.slider .before').length"), tab.ask("errors")

    reason = "they need 20 or more samples of the environment, and the sweep has 4"
    assert note.startswith(f"Nothing is said of built cars: {reason}. ")
    assert legend == "runs that passed, 95 % bandtrials"
    assert (hidden, curves, bars, errors) == (True, 0, 0, [])
