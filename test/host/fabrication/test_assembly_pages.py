"""Wiring and view of folded cars: their content follows the design."""

import json
import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import shapely

from browser import page_findings
from foldcar.car.components.bridge import BUTTON_PIN, DIVIDER_PIN, OE_PIN
from foldcar.fabrication.assembly.view_page import view_page
from foldcar.fabrication.assembly.wiring import wiring_drawing, wiring_text
from published_cars import PUBLISHED, car

Command = Callable[..., "subprocess.CompletedProcess[str]"]


def test_wiring_names_every_servo_with_its_output_and_direction() -> None:
    folded = car("w95")

    text = wiring_text(folded, "a car")
    drawn = "".join(ET.fromstring(wiring_drawing(folded, "a car")).itertext())

    for axle in folded.axles:
        (line,) = (line for line in text.splitlines() if line.startswith(f"| {axle.channel} |"))
        assert f"CH{axle.channel + 1}_DIRECTION {axle.direction:+d}" in line and axle.servo in line
        assert axle.servo in drawn and f"{axle.channel} · CH{axle.channel + 1}" in drawn
    assert "Outputs 4, 5, 6, 7 stay empty" in text


def test_texts_of_the_wiring_keep_off_each_other_and_off_lines() -> None:
    drawn = ET.fromstring(wiring_drawing(car("w95"), "a car"))

    boxes = {}
    for text in drawn.iterfind("{*}text"):
        x, y, size = (float(text.attrib[key]) for key in ("x", "y", "font-size"))
        length = size * sum(0.32 if c == " " else 0.95 if c in "mwMW" else 0.6 for c in text.text or "")
        start = x - length * {"start": 0, "middle": 0.5, "end": 1}[text.attrib["text-anchor"]]
        boxes[text.text, y] = shapely.box(start, y - 0.7 * size, start + length, y)
    lines = {}
    for path in drawn.iterfind("{*}path"):
        at = np.zeros(2)
        points: list[list[float]] = []
        for letter, numbers in re.findall(r"([MLHV])([-\d.,]+)", path.attrib["d"]):
            values = [float(number) for number in numbers.split(",")]
            at = np.array({"H": [values[0], at[1]], "V": [at[0], values[0]]}.get(letter, values))
            points = [*([] if letter == "M" else points), at.tolist()]
            if len(points) > 1:
                lines[str(points)] = shapely.LineString(points).buffer(float(path.attrib["stroke-width"]) / 2)
    # Symbols in a line, such as an extension with its length, cover it.
    rects = [[float(rect.attrib[key]) for key in ("x", "y", "width", "height")]
             for rect in list(drawn.iterfind("{*}rect"))[1:]]  # fmt: skip
    symbols = shapely.union_all([shapely.box(x, y, x + wide, y + high) for x, y, wide, high in rects if wide < 20])
    lines = {name: line.difference(symbols) for name, line in lines.items()}
    for dot in drawn.iterfind("{*}circle"):
        lines[str(dot.attrib)] = shapely.Point(float(dot.attrib["cx"]), float(dot.attrib["cy"])).buffer(1.1)
    assert {"terminal block", "135 mm", "65 mm more"} <= {text for text, _ in boxes}
    for (text, box), (other, its) in combinations([*boxes.items(), *lines.items()], 2):
        assert isinstance(text, str) or not box.intersects(its), (text, other)


def test_a_long_title_stays_on_the_wiring_drawing() -> None:
    title = "W_B_W+film=card_300+battery_place=roof width=245.5 height=50 radius=60"

    drawn = ET.fromstring(wiring_drawing(car("w95"), title))

    (heading,) = (text for text in drawn.iterfind("{*}text") if text.text == f"Wiring of {title}")
    # DejaVu Sans Bold's letters are 0.70 of their height wide on average in such titles, measured in Chromium.
    assert 0.72 * float(heading.attrib["font-size"]) * len(heading.text) <= 190 - 2 * 4.9
    (short,) = (text for text in ET.fromstring(wiring_drawing(car("w95"), "a car")).iterfind("{*}text")
                if text.text == "Wiring of a car")  # fmt: skip
    assert short.attrib["font-size"] == "5"


def test_wiring_offers_output_enable_with_a_pull_up_that_reaches_off() -> None:
    folded = car("w95")
    text, drawn = wiring_text(folded, "a car"), wiring_drawing(folded, "a car")

    # A divider of 2.2 kΩ to 3.3 V and the wing's 10 kΩ to ground; the PCA9685 takes 0.7 of its supply as high.
    off_v = 3.3 * 10 / (10 + 2.2)
    assert off_v > 1.15 * 0.7 * 3.3
    assert "2.2 kΩ" in text and f"at {off_v:.1f} V" in text and "above 2.3 V" in text and "2.2 kΩ" in drawn
    gate = (Path(__file__).parents[3] / "firmware/lib/feather_hal/output_gate.h").read_text(encoding="utf-8")
    assert f"kPin = {OE_PIN};" in gate and f"from {OE_PIN} of the" in text and f">{OE_PIN}<" in drawn


def test_wiring_offers_a_button_and_the_servos_battery_at_the_firmwares_pins() -> None:
    text = wiring_text(car("w95"), "a car")
    hal = Path(__file__).parents[3] / "firmware/lib/feather_hal"

    assert f"kButtonPin = {BUTTON_PIN};" in (hal / "feather_board.cpp").read_text(encoding="utf-8")
    assert f"servo_battery{{{DIVIDER_PIN}, 0.0f}}" in (hal / "feather_hal.h").read_text(encoding="utf-8")
    assert f"between {BUTTON_PIN} and GND" in text and f"to {DIVIDER_PIN} (A2)" in text
    # Four fresh alkaline cells at 6.4 V, through 20 and 10 kΩ.
    assert "20 kΩ" in text and "10 kΩ" in text and "the pin has 2.1 V" in text and "SERVO_DIVIDER 3 " in text


def test_view_page_is_one_file_of_valid_html() -> None:
    page = view_page(car("w95"), "a car")

    assert page_findings(page) == []
    assert "</script><" not in page.replace("</script>\n", "")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=", page)


def test_a_run_on_the_page_ends_at_the_goal(tmp_path: Path, foldcar: Command, free_course: Path) -> None:
    done = foldcar("view", free_course, "--set", "width=95", "--run", "1/0", "-o", tmp_path / "car.html")

    assert done.returncode == 0, done.stderr
    page = (tmp_path / "car.html").read_text(encoding="utf-8")
    run = json.loads(page.partition('id="car">')[2].partition("</script>")[0])["run"]
    first, last = run["rows"][0], run["rows"][-1]
    assert f"passed after {last[0]:.2f} s" in run["told"]
    goal = run["ground"]["scene"]["goal"]
    assert last[1] == pytest.approx(goal["x_m"], abs=0.025)
    # At the start the wheels carry the car at their radius, tyre included.
    assert first[3] == pytest.approx(0.06, abs=0.001)


@pytest.mark.parametrize(
    ("listing", "words", "message"),
    [
        (PUBLISHED, ["-o", "x.html"], "--vehicle"),
        (PUBLISHED, ["--vehicle", "w66", "-o", "x.html"], "w66"),
        (PUBLISHED, ["--vehicle", "w65", "--set", "width=30", "-o", "x.html"], "width"),
        (None, ["--set", "width=95", "--run", "1/x", "-o", "x.html"], "--run 1/x"),
        (None, ["--set", "width=95", "--run", "7/0", "-o", "x.html"], "7"),
        (None, ["--set", "width=95", "--run", "1/0", "--vehicle", "2", "-o", "x.html"], "vehicle 1"),
    ],
)
def test_view_refuses_cars_and_runs_that_there_are_not(
    foldcar: Command, free_course: Path, tmp_path: Path, listing: Path | None, words: list[str], message: str
) -> None:
    done = foldcar("view", listing or free_course, *words)

    assert done.returncode == 2 and message in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "x.html").exists()
