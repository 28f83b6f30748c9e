"""All mistakes of a listing at once, each with key, value, limit and the name that was meant; families with gaps."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.study.experiments import read_study
from page_check import study_of

APPENDIX_A = Path(__file__).parent / "data" / "appendix_a.json"
MIDDLE_HILL = """model model
param hillX = 0
param hillWidth = 1
param hillLength = 1
param hillHeight = 0.1
new GaussianHill at (globalParameters.hillX, 0), facing -90 deg,
    with sd_along globalParameters.hillLength / 4,
    with sd_across globalParameters.hillWidth / 4,
    with height globalParameters.hillHeight
ego = new Robot at (0.6, 0), facing -90 deg
goal = new Goal at (1.2, 0), facing -90 deg
"""
WriteListing = Callable[[Any], Path]


def test_the_published_listing_says_all_that_must_change_and_runs_then(tmp_path: Path, foldcar: Any) -> None:
    text = APPENDIX_A.read_text()
    listing = tmp_path / "l.json"
    listing.write_text(text)

    said = foldcar("sweep", "l.json", "--store", "s.db")

    assert said.returncode == 2
    assert said.stderr.splitlines() == [
        "foldcar: error: l.json: 6 mistakes:",
        '  experiments.3.veh_id: "5" is not among vehicles: 1',
        "  vehicles.1.params.0.common.height: 36 is below the minimum 47.74 (the boards and their plugs over the LiPo)",
        "  vehicles.1.params.3.W.tire_thickness: 1 is below the minimum 8 (the tongues of its rim)",
        "  vehicles.1.params.3.W.length: 40 is below the minimum 45.25 (the opening and screws of one servo); "
        "at that limit: 45.25 is below the minimum 59.5 (a segment of its own: one FS90R servo and the cap's tabs)",
        "  vehicles.1.params.1.B.length: 60 is below the minimum 79.7 (the boards and the square 4xAA holder)",
        "  environments.4.scenic_filename: middle_hill.scenic is not a file",
    ]
    limits = (('t":36', 't":47.74'), ('s":1', 's":8'), ('h":40', 'h":59.5'), ('h":60', 'h":79.7'))
    for before, after in (('"veh_id": 5', '"veh_id": 1'), *limits):
        assert text.count(before) == 1
        text = text.replace(before, after)
    listing.write_text(text)
    (tmp_path / "middle_hill.scenic").write_text(MIDDLE_HILL)
    done = foldcar("sweep", "l.json", "--store", "s.db", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1 runs new")


def test_all_mistakes_come_at_once_with_what_was_meant(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any
) -> None:
    (tmp_path / "pyramids.scenic").write_text("")
    listing_data["experiments"]["1"]["params"] = {"timeuot": 5, "environments": 0}
    listing_data["experiments"]["2"] = {"veh_id": "narow", "env_id": 1}
    listing_data["vehicles"]["narrow"] = {"type": "W_B_W", "params": [{"common": {"widht": 95, "height": 10}}]}
    listing_data["vehicles"]["1"]["params"] = [{"common": {"width": 20, "radius": 500}}]
    listing_data["environments"]["1"]["scenic_filename"] = "pyramid.scenic"
    file = write_listing(listing_data)

    with pytest.raises(FoldcarError) as caught:
        read_study(file)

    first, *mistakes = caught.value.lines()
    assert first == f"{file}: 7 mistakes:"
    expected = [
        ('experiments.1.params: unknown key "timeuot"', '; did you mean "timeout"?'),
        ("experiments.1.params.environments: 0: input should be greater than or equal to 1", ""),
        ('experiments.2.veh_id: "narow" is not among vehicles', '; did you mean "narrow"?'),
        ('vehicles.narrow.params.0.common: unknown parameter "widht"', '; did you mean "width"?'),
        ("vehicles.1.params.0.common.width: 20 is below the minimum 53.65", ""),
        ("vehicles.1.params.0.common.radius: 500 is above the maximum 150", ""),
        ("environments.1.scenic_filename: ", '; did you mean "pyramids.scenic"?'),
    ]
    for start, end in expected:
        assert [one for one in mistakes if one.startswith(f"  {start}") and one.endswith(end)], (start, mistakes)
    assert "\n" not in str(caught.value)


def test_cars_that_cannot_be_built_are_skipped_and_named(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, foldcar: Any
) -> None:
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [20, 95, 600]
    listing_data["experiments"]["1"]["params"]["environments"] = 1
    listing = write_listing(listing_data)
    why = [
        "width=20: width: 20 is below the minimum 53.65 (the boards across it)",
        "width=600: width: 600 is above the maximum 500",
    ]

    swept = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")
    report = foldcar("report", "s.db", "-o", "report", "--no-replay")
    rows = list(csv.DictReader(foldcar("export", "s.db", "--csv", "-").stdout.splitlines()))

    assert swept.returncode == 0, swept.stderr
    said = ["experiment 1: 2 of 3 cars cannot be built and are skipped:", *(f"  {one}" for one in why)]
    assert swept.stderr.splitlines()[1:] == said
    assert [row["width_mm"] for row in rows] == ["95"]
    remark = f"2 cars of the family cannot be built: {'; '.join(why)}."
    assert remark in study_of(tmp_path / "report")["experiments"][0]["remarks"]
    assert remark.replace(" ", "") in "".join(report.stdout.split())
    single = foldcar("run", listing, "--experiment", "1", "--set", "width=20")
    assert single.returncode == 2
    assert single.stderr.startswith("foldcar: error: --set width: 20 is below the minimum 53.65")
