"""What the page saves: charts as pictures, tables as the export writes them, from a file and inside another page."""

import csv
import html
import json
import time
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy
import pytest
from matplotlib import image

from browser import Tab, study_of
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

WIDTHS, RADII, SAMPLES = (80, 95, 245), (45, 60), 20
# Spreadsheets run a formula; commas and quotation marks are CSV's own.
VEHICLE, ENVIRONMENT = "=1+1", '-2, "steps"'
TITLE = "Wheels: how wide?"
SVG = "{http://www.w3.org/2000/svg}"


def page_of(folder: Path, cars: Mapping[str, list[int]], *options: str) -> Path:
    """The folder of a swept store, s.db, with two trials of its second width, and of its report."""
    listing = listing_of(STEP_PYRAMIDS, dict(cars), timeout=40, environments=SAMPLES)
    (experiment,) = listing["experiments"].values()
    experiment |= {"veh_id": VEHICLE, "env_id": ENVIRONMENT}
    for names, name in (("vehicles", VEHICLE), ("environments", ENVIRONMENT)):
        listing[names] = {name: listing[names]["1"]}
    (folder / "l.json").write_text(json.dumps(listing | {"title": TITLE}))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", *options)
    driven = ",".join(f"{name}_mm" for name in cars), ",".join(str(values[1]) for values in cars.values())
    rows = (
        f"vehicle_type,outcome,source,{driven[0]}",
        *(f"W_B_W,{how},notes,{driven[1]}" for how in ("passed", "stuck")),
    )
    (folder / "t.csv").write_text("\n".join([*rows, ""]))
    foldcar("trials", "import", folder / "s.db", folder / "t.csv", "--experiment", "1")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_save_figures", lambda *_: None)
        foldcar("report", folder / "s.db", "-o", folder / "report")
    foldcar("export", folder / "s.db", "--csv", folder / "export.csv")
    return folder


@pytest.fixture(scope="module")
def widths(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A study of one parameter, with realities."""
    return page_of(tmp_path_factory.mktemp("widths"), {"width": list(WIDTHS)}, "--realities", "300")


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A study of two parameters, without."""
    cars = {"width": list(WIDTHS), "radius": list(RADII)}
    return page_of(tmp_path_factory.mktemp("wheels"), cars, "--realities", "0")


def opened(study: Path, width: int = 1280) -> Tab:
    return Tab((study / "report" / "index.html").as_uri(), width)


def saved(tab: Tab, folder: Path, script: str) -> Path:
    """The file that the page saves when the script runs."""
    before = set(folder.iterdir())
    time.sleep(0.1)
    # Chromium lets a page save one file for each thing that a person does, and ten in a second.
    tab.send("Runtime.evaluate", expression=script, userGesture=True)
    for _ in range(100):
        new = [file for file in set(folder.iterdir()) - before if file.suffix != ".crdownload"]
        if new and new[0].stat().st_size:
            return new[0]
        time.sleep(0.1)
    raise AssertionError(f"{script}: nothing was saved")


def table(file: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Names and rows of a CSV file."""
    with file.open(encoding="utf-8", newline="") as text:
        reader = csv.DictReader(text)
        rows = list(reader)
    assert reader.fieldnames is not None
    return list(reader.fieldnames), rows


@pytest.mark.parametrize("study", ["widths", "wheels"])
def test_runs_are_saved_with_the_columns_and_cells_of_the_export(
    study: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    folder = request.getfixturevalue(study)
    names, exported = table(folder / "export.csv")
    with opened(folder) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.save_to(tmp_path)
        press = "document.querySelector('#listed .save button').click()"
        every = table(saved(tab, tmp_path, press))
        (tmp_path / "wheels-how-wide-runs.csv").unlink()
        tab.ask("study.set({ outcomes: ['stuck', 'tipped', 'off_course', 'timeout'] })")
        failed = table(saved(tab, tmp_path, press))
        assert tab.ask("errors") == []

    page_names, page_rows = every
    # The export's names in its order, without those of other metrics, messages and sampled values.
    assert page_names == [name for name in names if name in page_names]
    assert set(names) - set(page_names) == {
        *("distance_to_target_m", "consumed_energy_j", "max_roll_rad", "max_pitch_rad", "message"),
        *(name for name in names if name.startswith(("scene_", "car_"))),
    }
    assert page_rows[0]["vehicle"] == "'=1+1" and page_rows[0]["environment"] == '\'-2, "steps"'
    assert len(page_rows) == len(exported) > 10
    for page_row, row in zip(page_rows, exported, strict=True):
        time_s, exact_s = page_row.pop("elapsed_time_s"), row.pop("elapsed_time_s")
        assert abs(float(time_s) - float(exact_s)) < 0.000501
        assert page_row == {name: row[name] for name in page_row}
    rest = [row for row in exported if row["outcome"] != "passed"]
    assert 0 < len(rest) < len(exported)
    assert [row["sample"] for row in failed[1]] == [row["sample"] for row in rest]


def test_designs_are_saved_with_the_export_s_counts_in_the_order_of_the_table(wheels: Path, tmp_path: Path) -> None:
    names, exported = table(wheels / "export.csv")
    with opened(wheels) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.save_to(tmp_path)
        tab.ask("document.querySelector('#design-table details').open = true")
        tab.wait("document.querySelectorAll('#design-table thead button').length")
        tab.ask(
            "[...document.querySelectorAll('#design-table thead button')].find(b => /mass/.test(b.textContent)).click()"
        )
        tab.ask("study.brush('radius_mm', [[50, 70]])")
        file = saved(tab, tmp_path, "document.querySelector('#design-table [aria-label^=save]').click()")
        assert tab.ask("errors") == []
    (shown,) = study_of(wheels / "report")["experiments"]

    columns, rows = table(file)
    parameters = [name for name in names if name.endswith("_mm") and not name.startswith("scene_")]
    assert columns[:3] == ["experiment", "vehicle", "environment"] and columns[3 : 3 + len(parameters)] == parameters
    assert columns[3 + len(parameters) :][:5] == ["runs", "passed", "success", "success_low", "success_high"]
    assert columns[-5:] == ["time_s", "passing_time_s", "energy_j", "mass_g", "sheet_area_cm2"]
    assert [row["radius_mm"] for row in rows] == ["60"] * 3
    masses = [float(row["mass_g"]) for row in rows]
    assert masses == sorted(masses) and len(set(masses)) == 3
    for row in rows:
        own = [run for run in exported if all(run[name] == row[name] for name in parameters)]
        passed = sum(run["passed"] == "true" for run in own)
        assert (row["runs"], row["passed"], float(row["success"])) == (str(SAMPLES), str(passed), passed / SAMPLES)
        energy_j = sum(float(run["consumed_energy_j"]) for run in own)
        if passed:
            assert float(row["energy_j"]) == pytest.approx(energy_j / passed, rel=1e-4)
        assert row["built_cars_success"] == "" and row["trials"] == ("2" if row["width_mm"] == "95" else "0")
    assert shown["designs"]["measures"][-1]["unit"] == "cm²"


LIGHT, DARK = ({"name": "prefers-color-scheme", "value": value} for value in ("light", "dark"))


@pytest.mark.parametrize("study", ["widths", "wheels"])
def test_every_chart_is_saved_as_picture_and_numbers(study: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    files: dict[str, list[Path]] = {}
    with opened(request.getfixturevalue(study)) as tab:
        tab.send("Emulation.setEmulatedMedia", features=[DARK])
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.save_to(tmp_path)
        labels = tab.ask("[...document.querySelectorAll('.chart')].map(chart => chart.parentElement.querySelector("
                         "'.save button').ariaLabel.replace('save as SVG: ', ''))")  # fmt: skip
        for n, label in enumerate(labels):
            buttons = f"document.querySelectorAll('figure .save')[{n}].querySelectorAll('button')"
            assert tab.ask(f"[...{buttons}].map(button => button.textContent)") == ["SVG", "PNG", "CSV"]
            files[label] = [saved(tab, tmp_path, f"{buttons}[{k}].click()") for k in range(3)]
        assert tab.ask("errors") == []

    assert len(files) == len(labels) >= 6
    for label, (svg, png, numbers) in files.items():
        assert svg.name.startswith("wheels-how-wide-") and {svg.stem} == {png.stem} == {numbers.stem}
        text = svg.read_text(encoding="utf-8")
        root = ElementTree.fromstring(text)
        size = [round(float(root.attrib[name])) for name in ("width", "height")]
        words = " ".join("".join(part.itertext()) for part in root.iter(f"{SVG}text"))
        # Its own fonts and colours: those of paper, though the page is dark.
        assert TITLE in words and " ".join(label.split()[:3]) in words
        assert "inherit" not in text and "DejaVu Sans" in text and "var(" not in text and "href" not in text
        assert "rgb(34,34,34)" in text.replace(" ", "") or "#222" in text or "#5b5850" in text
        assert "#e8e6e1" not in text and "#17191c" not in text
        assert any(part.attrib.get("fill") == "#fff" for part in root.iter(f"{SVG}rect"))
        pixels = image.imread(png)
        assert pixels.shape[:2] == (2 * size[1], 2 * size[0])
        corners = pixels[[2, 2, -2, -2], [2, -2, 2, -2]]
        assert numpy.allclose(corners[:, :3], 1)
        # Something is drawn all over the chart's height.
        inked = (pixels[:, :, :3].min(axis=2) < 0.9).any(axis=1)
        assert inked[: len(inked) // 2].mean() > 0.3 and inked[len(inked) // 2 :].mean() > 0.3
        names, rows = table(numbers)
        assert rows and len(set(names)) == len(names) and all(name.isascii() and " " not in name for name in names)


def test_the_success_chart_s_numbers_are_those_of_the_page(widths: Path, tmp_path: Path) -> None:
    with opened(widths) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        tab.save_to(tmp_path)
        press = "document.querySelector('[data-chart=curve] [aria-label^=\"save as CSV\"]').click()"
        names, rows = table(saved(tab, tmp_path, press))
    (shown,) = study_of(widths / "report")["experiments"]
    designs, rates = shown["designs"], shown["realities"]["rates"]

    assert [row["width_mm"] for row in rows] == [str(width) for width in WIDTHS]
    for column, key in (("built_cars_success", "belief"), ("built_cars_success_low", "belief_low"), ("success", "rate"),
                        ("trials_passed", "trials_passed"), ("trials_success_high", "trials_high")):  # fmt: skip
        assert [float(row[column]) if row[column] else None for row in rows] == designs[key]
    assert names[-1] == f"reality_{len(rates)}_success"
    assert [float(row["reality_1_success"]) for row in rows] == rates[0]


def test_a_page_inside_another_page_saves_files(widths: Path, tmp_path: Path) -> None:
    page = (widths / "report" / "index.html").read_text(encoding="utf-8")
    (tmp_path / "outer.html").write_text(f'<iframe width="900" height="800" srcdoc="{html.escape(page)}"></iframe>')
    (tmp_path / "saved").mkdir()
    with Tab((tmp_path / "outer.html").as_uri()) as tab:
        frame = "document.querySelector('iframe').contentDocument"
        tab.wait("document.querySelector('iframe')?.contentDocument")
        tab.wait(f"{frame}.body?.dataset.state === 'ready'")
        tab.save_to(tmp_path / "saved")
        for k, ending in enumerate((".svg", ".png", ".csv")):
            button = f"{frame}.querySelector('[data-chart=curve] .save').querySelectorAll('button')[{k}]"
            file = saved(tab, tmp_path / "saved", f"{button}.click()")
            assert file.name == f"wheels-how-wide-curve{ending}"
        assert tab.ask("document.querySelector('iframe').contentWindow.errors") == []
