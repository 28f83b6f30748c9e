"""The experiment listing: valid files are read, all mistakes named at once, cars that cannot be built left out."""

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.errors import FoldcarError
from foldcar.store.trial_writer import write_trials
from foldcar.study.experiments import read_study
from foldcar.study.listing_file import load_listing, read_listing, validated_listing

PUBLISHED_STYLE = """{
  // as printed: comments, trailing commas, ids as numbers and as strings
  "experiments": {"3": {"veh_id": 5, "env_id": "4", "params": {"timeout": 400}}},
  "vehicles": {"5": {"type": "W_B_W", "params": [
    {"common": {"width": 80, "height": 48, "radius": 30,}},
    {"B": {"length": 120}},
    {"W": {"tire_thickness": 1, "radius": 30, "length": 40}},
  ]}},
  "environments": {"4": {
    "scenic_filename": "hill.scenic", "wbt_filename": "StandardMap.wbt", "seed": 42,
    "scenic_params": {"hillX": -0.3, "hillWidth": 1.25},
  }},
}"""


KEYS = "title, notes, experiments, vehicles, environments"


@pytest.mark.parametrize(
    "name",
    ["1 fresh", "1 (side-view)", "1 (MuJoCo, half step)", "1 (reality mine 12ab)", "a (realities)"],
)
def test_names_of_variants_are_no_names_of_experiments(
    write_listing: Callable[[Any], Path], listing_data: Any, name: str
) -> None:
    listing_data["experiments"] = {name: listing_data["experiments"]["1"]}
    with pytest.raises(FoldcarError, match=f'"{re.escape(name)}": ends like the names that foldcar gives to variants'):
        read_study(write_listing(listing_data))
    listing_data["experiments"] = {"fresh (air)": listing_data["experiments"][name]}
    assert read_study(write_listing(listing_data)).experiments[0].id == "fresh (air)"
    listing_data["experiments"] = {" fresh": listing_data["experiments"]["fresh (air)"]}
    with pytest.raises(FoldcarError, match='" fresh": begins or ends with a blank'):
        read_study(write_listing(listing_data))


def change(data: Any, path: str, value: Any) -> Any:
    """Set (or, with None, delete) what stands at a dotted path."""
    *steps, last = path.split(".")
    node = data
    for step in steps:
        node = node[int(step) if isinstance(node, list) else step]
    if value is None:
        del node[last]
    else:
        node[last] = value
    return data


def test_the_published_form_is_read(write_listing: Callable[[Any], Path]) -> None:
    file = write_listing(PUBLISHED_STYLE)

    data, text = load_listing(file)
    listing, mistakes = validated_listing(data)

    assert text == PUBLISHED_STYLE and mistakes == []
    assert (listing.experiments["3"].veh_id, listing.experiments["3"].env_id) == ("5", "4")
    assert listing.experiments["3"].params.timeout == 400
    assert listing.vehicles["5"].params[2]["W"] == {"tire_thickness": (1,), "radius": (30,), "length": (40,)}
    assert listing.environments["4"].scenic_params == {"hillX": -0.3, "hillWidth": 1.25}


def test_a_byte_order_mark_is_no_part_of_a_listing(write_listing: Callable[[Any], Path], listing_data: Any) -> None:
    file = write_listing(listing_data)
    text = file.read_text()
    file.write_text(f"\ufeff{text}", encoding="utf-8")

    assert read_listing(file)[1] == text


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"from": 65, "to": 80, "step": 5}, [65, 70, 75, 80]),
        ({"from": 65, "to": 66.1, "step": 0.1}, [65 + k / 10 for k in range(12)]),
        ({"from": 65.3, "to": 65.9, "step": 0.3}, [65.3, 65.6, 65.9]),
        ([100, 70.5], [100, 70.5]),
    ],
)
def test_numbers_lists_and_ranges_make_families(
    write_listing: Callable[[Any], Path], listing_data: Any, values: Any, expected: list[float]
) -> None:
    file = write_listing(change(listing_data, "vehicles.1.params.0.common.width", values))

    (experiment,) = read_study(file).experiments

    assert [design.values["width"] for design in experiment.family] == expected


WIDTH = "vehicles.1.params.0.common.width"


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("experiments", {}, ": {} is empty"),
        ("enviroments", {}, f': unknown key; known: {KEYS}; did you mean "environments"?'),
        ("vehicle", {}, f': unknown key; known: {KEYS}; did you mean "vehicles"?'),
        ("vehicles.1.typ", "W_B_W", ': unknown key; known: type, parts, params; did you mean "type"?'),
        ("environments.1.condition", {"sample": 0, "object": []}, ".object: unknown key; known: sample, objects, "),
        ("experiments.1.veh_id", 7, ': no "7"; known: 1'),
        ("experiments.1.params.timeout", 0, ": 0 is not above 0"),
        ("experiments.1.params.timeout", "1", ": '1' is not a number"),
        ("experiments.1.params.timeuot", 5, ": unknown key; known: timeout, "),
        ("experiments.1.params.variation", {"from": "workshop", "luck": 1}, "experiments.1.params.variation"),
        (
            "experiments.1.params.variation_seed",
            3,
            'experiments.1.params: "variation_seed" has no effect without "variation"',
        ),
        ("environments.1.condition", {}, ".sample: is missing"),
        ("environments.1.scenic_filename", "no.scenic", ": "),
        ("vehicles.1.type", "W_Q_W", ': "W_Q_W" has unknown module "Q"; known: W'),
        ("vehicles.1.type", "W_B_H", ': "W_B_H" has a hinge (H) at an end or beside another: each joins'),
        ("vehicles.1.type", "W_W", ': "W_W" has no module B'),
        ("vehicles.1.params.0.H", {"length": 20}, ": W_B_W has no module H; known: common, B, W"),
        ("vehicles.1.params.0.common.widht", 9, 'vehicles.1.params.0.common: unknown parameter "widht"; known: he'),
        ("vehicles.1.params.0.W", {"width": 96}, ".width: differs from vehicles.1.params.0.com"),
        (WIDTH, 20, ": 20 is below the minimum 53.65 (the boards across it)"),
        (WIDTH, 501, ": 501 is above the maximum 500"),
        (WIDTH, True, ": True is not a number; write a number, a list of numbers or a range"),
        (WIDTH, 0.095, ": 0.095 is below the minimum 53.65 (the boards across it); lengths of cars are in mm: 0.095 m"),
        (WIDTH, [80, 95, 95], ": 95 occurs twice in the list"),
        (WIDTH, {"from": 1}, ': a range has exactly the keys "from", "to", "step"'),
        (WIDTH, {"from": 65, "to": 90, "step": 1e-9}, ": the range has 25000000001 values, the limit is"),
        (WIDTH, {"from": 0, "to": 1e300, "step": 1e-300}, ".to: 1e+300 is out of bounds"),
        (WIDTH, int("9" * 400), ": the number is above the limit"),
        (
            WIDTH,
            {"from": 65, "to": 245, "step": 7},
            ': "to" 245 is not reached in steps of 7; the last value is 240',
        ),
    ],
)
def test_a_mistake_is_named_with_file_key_value_and_limit(
    write_listing: Callable[[Any], Path], listing_data: Any, path: str, value: Any, message: str
) -> None:
    file = write_listing(change(listing_data, path, value))

    with pytest.raises(FoldcarError) as caught:
        for experiment in read_study(file).experiments:
            list(experiment.family)

    # Of most mistakes the message begins with the path.
    expected = path + message if message[0] in ":." else message
    assert str(caught.value).startswith(f"{file}: {expected}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not JSON: "),
        ('{"a": 1\n "b": 2}', 'is not JSON: line 2, column 2: a comma is missing before "b": 2}'),
        ('{"a": 1, "a": 2}', "is not JSON: Duplicate key"),
        ("[" * 10000, "is nested too deeply"),
        ('{"title": "\\ud83d"}', "\\ud83d: is half a character"),
        ("[]", "the file: [] is not a JSON object"),
        ("\x00", "is not UTF-8 text (it contains NUL characters)"),
    ],
)
def test_invalid_listings_are_refused(write_listing: Callable[[Any], Path], text: str, message: str) -> None:
    file = write_listing(text)

    with pytest.raises(FoldcarError) as caught:
        read_listing(file)

    assert str(caught.value).startswith(f"{file}: {message}")
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    latin = tmp_path / "latin.json"
    latin.write_bytes(b'{"\xe9": 1}')
    store = tmp_path / "s.db"
    with write_trials(store):
        pass

    for file, message in (
        (tmp_path / "none.json", "cannot be read: No such file or directory"),
        (tmp_path / "latn.json", 'cannot be read: No such file or directory; did you mean "latin.json"?'),
        (tmp_path, "cannot be read: Is a directory"),
        (latin, "is not UTF-8 text (byte 2): save it as UTF-8"),
        (store, "is a store, which `foldcar report` reads; a listing is a JSON file"),
    ):
        with pytest.raises(FoldcarError) as caught:
            read_listing(file)
        assert str(caught.value) == f"{file}: {message}"


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


def test_the_published_listing_says_all_that_must_change_and_runs_then(tmp_path: Path, foldcar: Any) -> None:
    text = (Path(__file__).parents[1] / "data" / "appendix_a.json").read_text()
    listing = tmp_path / "l.json"
    listing.write_text(text)

    answer = foldcar("sweep", "l.json", "--store", "s.db")

    assert answer.returncode == 2
    assert answer.stderr.splitlines() == [
        "foldcar: error: l.json: 5 mistakes:",
        '  experiments.3.veh_id: no "5"; known: 1',
        "  vehicles.1.params.0.common.height: 36 is below the minimum 47.74 (the boards and their plugs over the LiPo)",
        "  vehicles.1.params.3.W.tire_thickness: 1 is below the minimum 8 (the tongues of its rim)",
        "  vehicles.1.params.3.W.length: 40 is below the minimum 45.25 (the opening and screws of one servo)",
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
    assert done.stdout.startswith("1 new run")


def test_all_mistakes_come_at_once_with_what_was_meant(
    tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any
) -> None:
    (tmp_path / "pyramids.scenic").write_text("")
    listing_data["experiments"]["2"] = {"veh_id": "narow", "env_id": 1}
    listing_data["vehicles"]["narrow"] = {"type": "W_B_W", "params": [{"common": {"widht": 95, "height": 10}}]}
    listing_data["vehicles"]["1"]["params"] = [{"common": {"width": 20, "radius": 500}}]
    listing_data["environments"]["1"]["scenic_filename"] = "pyramid.scenic"
    file = write_listing(listing_data)

    with pytest.raises(FoldcarError) as caught:
        read_study(file)

    first, *mistakes = caught.value.lines()
    assert first == f"{file}: 5 mistakes:"
    expected = [
        ('experiments.2.veh_id: no "narow"', '; did you mean "narrow"?'),
        ('vehicles.narrow.params.0.common: unknown parameter "widht"', '; did you mean "width"?'),
        ("vehicles.1.params.0.common.width: 20 is below the minimum 53.65", ""),
        ("vehicles.1.params.0.common.radius: 500 is above the maximum 150", ""),
        ("environments.1.scenic_filename: ", '; did you mean "pyramids.scenic"?'),
    ]
    for start, end in expected:
        assert [mistake for mistake in mistakes if mistake.startswith(f"  {start}") and mistake.endswith(end)], (
            start,
            mistakes,
        )
    assert "\n" not in str(caught.value)
    listing_data["experiments"]["1"]["params"] = {"timeuot": 5, "environments": 0}
    mistakes = r"2 mistakes: .*environments: 0 is below the minimum 1; .*timeuot: unknown key"
    with pytest.raises(FoldcarError, match=mistakes):
        read_study(write_listing(listing_data))


def test_cars_that_cannot_be_built_are_skipped_and_named(
    tmp_path: Path, write_listing: Callable[[Any], Path], listing_data: Any, foldcar: Any
) -> None:
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [20, 95, 600]
    listing_data["experiments"]["1"]["params"]["environments"] = 1
    listing = write_listing(listing_data)
    why = [
        "width=20 mm: width: 20 is below the minimum 53.65 (the boards across it)",
        "width=600 mm: width: 600 is above the maximum 500",
    ]

    dry = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1", "--dry-run")
    assert not (tmp_path / "s.db").exists()
    swept = foldcar("sweep", listing, "--store", "s.db", "--jobs", "1")
    report = foldcar("report", "s.db", "-o", "report")
    rows = list(csv.DictReader(foldcar("export", "s.db", "--csv", "-").stdout.splitlines()))

    assert swept.returncode == 0, swept.stderr
    warning = ["experiment 1: 2 of 3 cars cannot be built and are skipped:", *(f"  {reason}" for reason in why)]
    assert swept.stderr.splitlines()[1:] == warning
    head, refused, *lines = dry.stdout.splitlines()
    assert head == "experiment 1: 3 designs, 1 run if all can be built"
    assert refused == "  2 of 3 cannot be built and would be skipped:"
    assert lines[:2] == [f"    {reason}" for reason in why]
    assert re.fullmatch(r"about [0-9.]+ s with 1 simulator; the store about 0\.[0-9] MB", lines[2])
    assert [row["width_mm"] for row in rows] == ["95"]
    remark = f"2 cars of the family cannot be built: {'; '.join(why)}."
    assert remark in study_of(tmp_path / "report")["experiments"][0]["remarks"]
    assert remark.replace(" ", "") in "".join(report.stdout.split())
    single = foldcar("run", listing, "--experiment", "1", "--set", "width=20")
    assert single.returncode == 2
    assert single.stderr.startswith("foldcar: error: --set width: 20 is below the minimum 53.65")


def test_a_value_that_the_family_lacks_is_remarked_on(foldcar: Any, write_listing: Any, listing_data: Any) -> None:
    listing = write_listing(listing_data)

    outside, inside = (foldcar("run", listing, "--experiment", "1", "--set", f"width={w}") for w in (96, 95))

    remark = "note: width=96 is not one of the family's values, 95 and 245: a sweep has no such car\n"
    assert (outside.returncode, outside.stderr, inside.stderr) == (0, remark, "")


def test_a_scenic_program_is_not_a_listing(refused: Any, tmp_path: Path) -> None:
    (tmp_path / "yard.scenic").write_text("model model\n")

    message = "yard.scenic: is a Scenic program; name a listing that has it as a scenic_filename (docs/listing.md)"
    assert refused("sweep", "yard.scenic", "--store", "s.db") == message
