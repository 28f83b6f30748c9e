"""Links to a view of the study page: one place says what of a link cannot be followed, and what is shown instead."""

import json
from pathlib import Path

import pytest

from browser import READY, Tab
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar, reported

REMARKS = "[...document.querySelectorAll('#link-remarks li')].map(item => item.textContent)"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The page of a swept store."""
    return reported(tmp_path_factory.mktemp("page"), (95, 120), 6) / "report" / "index.html"


def test_what_of_a_link_cannot_be_followed_is_said_until_the_reader_goes_on(page: Path) -> None:
    link = (
        "e=7&design=99+mm&env=66&outcome=flown,passed&b.constructor=1..2&b.width_mm=wide&x=beauty&t=0x10&r.mood=1&r.constructor=2&r.__proto__=3&at=nowhere"
        "&r.friction=50&r.servo_torque=0.8&r.com_height_m=-5"
    )
    with Tab(f"{page.as_uri()}#{link}") as tab:
        tab.wait("document.getElementById('whatif')?.dataset.done")
        remarks = tab.ask("[...document.querySelectorAll('#link-remarks li')].map(item => item.textContent)")
        sliders = tab.ask("study.e.drives.sliders")
        state, values = (
            tab.ask("study.state"),
            tab.ask("[...document.querySelectorAll('.slider output')].map(o => o.value)"),
        )
        tab.ask("study.open(1, 2)")
        assert tab.ask("document.getElementById('link-remarks').hidden") and tab.ask("errors") == []

    limits, no_sliders = {slider["name"]: slider for slider in sliders}, ("mood", "constructor", "__proto__")
    friction, height = limits["friction"], limits["com_height_m"]
    low, high, lowest, highest = (
        f"{scale * slider[end]:.3g} {unit}"
        for slider, scale, unit in ((friction, 1, "×"), (height, 1000, "mm"))
        for end in ("low", "high")
    )
    assert remarks == [
        "The link's b.width_mm=wide is not a range such as 65..95.",
        "The link's t=0x10 is not a number of 0 or more.",
        "The link's at=nowhere is not one of summary, belief, whatif, parameters, runs, trials, origin.",
        "The link is of experiment 7, which this page does not have: this is experiment 1.",
        "The link's design 99 mm is not in experiment 1.",
        "The link's environment 66 does not exist: experiment 1 has 6.",
        remarks[6],
        "The link keeps a range of constructor, which no design has.",
        "The link's axis x=beauty does not exist.",
        *(f"The link has a value of {name}, for which this page has no slider." for name in no_sliders),
        f"The link's friction, 50 ×, is outside the slider's limits, {low} to {high}: it is set to {high}.",
        f"The link's centre of mass, raised, -5000 mm, is outside the slider's limits, {lowest} to {highest}: "
        f"it is set to {lowest}.",
    ]
    assert remarks[6].startswith("The link's outcome flown is not one of passed, ")
    assert state["outcomes"] == ["passed"] and state["brushes"] == {} and state["design"] is state["env"] is None
    assert state["reality"] == {"friction": friction["high"], "servo_torque": 0.8, "com_height_m": height["low"]}
    assert values[0] == high


def test_a_link_that_can_be_followed_needs_no_remark(page: Path) -> None:
    link = "e=1&design=95+mm&env=2&t=0.5&outcome=passed&b.width_mm=90..100&x=time&r.friction=0.8&at=runs"
    with Tab(f"{page.as_uri()}#{link}") as tab:
        tab.wait(READY)
        assert tab.ask("document.getElementById('link-remarks').hidden")
        # Another link in the same page moves the sliders, too.
        tab.ask("location.hash = '#r.friction=500'")
        tab.wait("document.querySelector('#link-remarks li')?.textContent.includes('friction, 500')")
        limit = tab.ask("study.e.drives.sliders.find(slider => slider.name === 'friction').high")
        assert tab.ask("document.querySelector('.slider output').value") == f"{limit:.3g} ×"
        assert json.loads(tab.ask("JSON.stringify(study.state.reality)")) == {"friction": limit}
        assert tab.ask("errors") == []


@pytest.mark.parametrize(
    ("link", "remarks"),
    [
        ("env=1.5&design=95+mm", ["The link's env=1.5 is not an integer of 0 or more."]),
        (
            "r.friction=0.7&r.friction=0.8&x=time&x=width_mm",
            [
                "The link gives r.friction 2 times: the last, 0.8, counts.",
                "The link gives x 2 times: the last, width_mm, counts.",
            ],
        ),
        ("mx=width_mm", ["The link's axis mx=width_mm cannot be an axis of the map of experiment 1."]),
        ("env=3&t=0.5", [
            "The link's environment 3 is shown for a design only, and the link has none.",
            "The link's time, 0.5 s, is of no run that this page has.",
        ]),
        ("environment=3", ["The link's environment=3 means nothing to this page."]),
    ],
)  # fmt: skip
def test_what_is_shown_instead_of_what_a_link_asks_for(page: Path, link: str, remarks: list[str]) -> None:
    with Tab(f"{page.as_uri()}#{link}") as tab:
        tab.wait(READY)
        assert tab.ask(REMARKS) == remarks
        state = tab.ask("study.state")
        assert tab.ask("errors") == []

    assert state["env"] in (None, 3) and state["t"] is state["mx"] is None
    assert ("friction" not in link) or (state["reality"], state["x"]) == ({"friction": 0.8}, "width_mm")


def test_a_time_after_the_end_of_the_drive_shows_the_end_and_says_so(page: Path) -> None:
    with Tab(f"{page.as_uri()}#design=95+mm&env=2&t=99") as tab:
        (remark,) = tab.wait(f"{REMARKS}.length && {REMARKS}", 20)
        end, shown = (float(tab.ask(f"document.getElementById('replay').dataset.{name}")) for name in ("end", "t"))
        assert remark == f"The link's time, 99 s, is after the end of the drive, {end:.2f} s: the end is shown."
        assert shown == pytest.approx(end, abs=1e-3) and tab.ask("study.state.t") == pytest.approx(end, abs=0.006)
        # A link to the end, as the page itself writes it, is no mistake.
        tab.ask(f"location.hash = '#design=95+mm&env=2&e=1&t={end:.2f}'")
        tab.wait(f"!{REMARKS}.length", 20)
        # Another time of the same run.
        tab.ask("location.hash = '#design=95+mm&env=2&t=77'")
        assert tab.wait(f"{REMARKS}.length && {REMARKS}", 20)[0].startswith("The link's time, 77 s, is after the end ")
        assert tab.ask("errors") == []


def test_a_section_alone_is_a_link(page: Path) -> None:
    with Tab(f"{page.as_uri()}#runs") as tab:
        tab.wait(READY)
        assert tab.ask(REMARKS) == [] and tab.wait("study.state.at === 'runs'")
        assert tab.ask("document.getElementById('runs').getBoundingClientRect().top < innerHeight")


@pytest.fixture(scope="module")
def two_parameters(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The page of a study over width and height, which has a map."""
    folder = tmp_path_factory.mktemp("map")
    listing = listing_of(STEP_PYRAMIDS, {"width": [80, 120], "height": [50, 60]}, environments=2)
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db")
    foldcar("report", folder / "s.db", "-o", folder / "report")
    return folder / "report" / "index.html"


def test_an_axis_that_a_link_leaves_open_is_another_one_than_the_other(two_parameters: Path) -> None:
    axes = "[...document.querySelectorAll('#belief-charts select, #designs select')].map(list => list.value)"
    with Tab(two_parameters.as_uri()) as tab:
        tab.wait(READY)
        first, second, x, y = tab.ask(axes)
        tab.ask(f"location.hash = '#mx={second}&x={y}'")
        tab.wait(f"study.state.mx === '{second}'")
        assert tab.ask(axes)[:3] == [second, first, y] and tab.ask(axes)[3] != y
        tab.ask(f"location.hash = '#my={first}&y={x}'")
        tab.wait(f"study.state.my === '{first}'")
        assert tab.ask(axes)[:2] == [second, first] and tab.ask(axes)[3] == x != tab.ask(axes)[2]
        tab.ask("location.hash = '#mx=success'")
        remark = tab.wait(f"{REMARKS}[0]")
        assert remark == "The link's axis mx=success cannot be an axis of the map of experiment 1."
        assert tab.ask(axes)[:2] == [first, second] and tab.ask("errors") == []
