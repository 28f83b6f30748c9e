"""Names of built cars: a car stays the same in all its trials, in simulation too; designs are judged by their cars."""

import json
from pathlib import Path
from typing import Any

from foldcar.belief.reality import drawn_reality
from foldcar.car.variation import named_car
from foldcar.commands.listed_run import listed_run
from foldcar.study.reality_environment import read_reality
from live_car import LOG, car_at_port, trials_in, write_free_course
from study_car import listing_of

STEP_PYRAMIDS = Path(__file__).resolve().parents[3] / "scenarios" / "step_pyramids.scenic"


def write_listing(folder: Path, **params: Any) -> Path:
    data = listing_of(STEP_PYRAMIDS, {"width": [180, 120]}, timeout=120, environments=30, **params)
    (folder / "l.json").write_text(json.dumps(data))
    return folder / "l.json"


def test_a_named_car_is_the_same_in_every_sample_and_no_other(tmp_path: Path) -> None:
    listing = write_listing(tmp_path, variation="workshop")
    first, second = (listed_run(listing, "1", ["width=180"], k) for k in (0, 1))
    ada = first.variation_in(0, "Ada")

    assert ada == first.variation_in(1, "Ada") == second.variation_in(0, "Ada") and first.scene != second.scene
    assert first.variation_in(0) == first.variation and first.variation_in(1) == second.variation
    assert len({json.dumps(car) for car in (ada, first.variation_in(0, "Ben"), first.variation_in(0))}) == 3
    # Under a reality the start scatters in each trial.
    (tmp_path / "reality.json").write_text('{"wheel_spread": 1.5, "start_heading_sd_rad": 0.1}')
    values, experiment = read_reality(tmp_path / "reality.json", "multibody").values, first.experiment
    ada_0, ada_1, ben_0 = (
        drawn_reality(values, experiment.variation, experiment.variation_seed, sample, named_car(car))
        for sample, car in ((0, "Ada"), (1, "Ada"), (0, "Ben"))
    )
    assert ada_0["servo_torque"] == ada_1["servo_torque"] != ben_0["servo_torque"]
    assert ada_0["start_heading_rad"] != ada_1["start_heading_rad"] and ada_0["start_x_m"] == ben_0["start_x_m"]


def test_a_driven_trial_has_its_cars_name_which_a_correction_changes(tmp_path: Path, foldcar: Any, refused: Any) -> None:
    write_free_course(tmp_path)
    with car_at_port() as car:
        driven = foldcar(*LOG, "--port", car.port, "--yes", "--trials", "1", "--countdown", "0", "--car", " Ada ")
    assert driven.returncode == 0, driven.stderr
    assert [trial.car_name for trial in trials_in(tmp_path / "s.db")] == ["Ada"]

    corrected = foldcar("trials", "correct", "s.db", "1", "--car", "Ben", "--reason", "two of them")
    assert '"Ada" -> "Ben"' in corrected.stdout
    assert "Ben" in foldcar("trials", "list", "s.db").stdout
    assert foldcar("export", "s.db", "--trials", "t.csv", "--simulated-trials").returncode == 0
    assert ",Ben," in (tmp_path / "t.csv").read_text()
    long = "--car: 'xxxxxxxxxx"
    assert refused(*LOG, "--port", "none", "--car", "x" * 50).startswith(long)
    assert "is not a name of 1 to 40" in refused("trials", "correct", "s.db", "1", "--car", "", "--reason", "x")


def test_each_car_of_a_design_is_counted_by_itself(tmp_path: Path, foldcar: Any) -> None:
    write_listing(tmp_path, variation="workshop")
    assert foldcar("sweep", "l.json", "--store", "s.db", "--samples", "20", "--realities", "1000").returncode == 0
    lines = ["vehicle_type,outcome,source,width_mm,sample,car_name"]
    for at in range(8):
        outcome, car = ("passed" if at % 2 else "stuck"), ("Ada" if at < 4 else "Ben")
        lines += [f"W_B_W,{outcome},notes,180,{at},{car}", f"W_B_W,{outcome},notes,120,{at},"]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    assert foldcar("trials", "import", "s.db", "t.csv", "--experiment", "1").returncode == 0

    (experiment,) = json.loads(foldcar("compare", "s.db", "--json").stdout)["experiments"]

    two_cars, one_car = experiment["designs"]
    assert [two_cars["cars"], one_car["cars"], two_cars["trials"], one_car["trials"]] == [2, 1, 8, 8]
    assert two_cars["driven"]["method"].endswith("8 trials of 2 cars")
    remarks = " ".join(experiment["remarks"])
    assert "Some trials of 120 mm have no car's name." in remarks
    shown = foldcar("compare", "s.db").stdout
    assert "further car %" in shown and "these: the cars that drove" in shown
