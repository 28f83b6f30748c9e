"""`foldcar link --reality`: a simulated car and ground that differ from what the host believes, by named parameters."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foldcar.belief.priors import NOMINAL
from foldcar.belief.reality import GROUND_FACTORS, drawn_reality
from foldcar.commands.listed_run import listed_run, simulated_run
from foldcar.errors import FoldcarError
from foldcar.store.reader import Store
from foldcar.study.reality_environment import read_reality

# Differences between wheels stay those of the listing.
NOMINAL_REALITY = {name: value for name, value in NOMINAL.items() if name != "wheel_spread"}
LISTING = Path(__file__).resolve().parents[3] / "scenarios" / "width_study.json"


def test_a_reality_changes_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "reality.json"
    file.write_text('{"obstacle_height": 1.3, "servo_torque": 0.6, "track_m": 0.016}')
    run = listed_run(LISTING, "1", ["width=95"], 3)

    values = read_reality(file, "multibody").values
    reality = drawn_reality(values, {}, run.experiment.variation_seed, 3, 3)

    assert {name for name, value in values.items() if value != NOMINAL[name]} == {
        "obstacle_height",
        "servo_torque",
        "track_m",
    }
    assert {name: value for name, value in reality.items() if name in GROUND_FACTORS} == {
        "friction": 1, "obstacle_height": 1.3,
    }  # fmt: skip
    assert reality.pop("track_m") == 0.016 and reality.pop("servo_torque") == pytest.approx([-0.4] * 8)
    others = [value for name, value in reality.items() if name not in GROUND_FACTORS and "phase" not in name]
    assert set(np.hstack(others)) == {0.0}


def test_what_the_host_believes_may_be_the_truth(tmp_path: Path) -> None:
    """Some nominal values, as no differences between wheels, are the end of what may be."""
    file = tmp_path / "reality.json"
    file.write_text(json.dumps(dict(NOMINAL)))

    assert read_reality(file, "multibody").values == NOMINAL


def test_what_no_trial_teaches_reaches_the_car_in_mujoco(tmp_path: Path) -> None:
    """Camber, soft tyres, a centre of mass aside and ahead, a supply that sags: each makes another run."""
    listed = listed_run(LISTING, "1", ["width=95"], 3, "mujoco")
    facts = {"wheel_camber_rad": -0.035, "tyre_contact_time_s": 0.02, "com_x_m": 0.004, "com_y_m": 0.006,
            "supply_resistance_ohm": 0.4}  # fmt: skip
    file = tmp_path / "reality.json"

    run, _ = simulated_run(listed)

    def elapsed_s(values: dict[str, float]) -> float:
        file.write_text(json.dumps(values))
        real = read_reality(file, "mujoco").values
        assert real == {**NOMINAL_REALITY, **values}
        reality = drawn_reality(real, {}, listed.experiment.variation_seed, 3, 3)
        assert {name: reality[name] for name in values} == values
        return float(replace(run, reality=reality).simulate(listed.carsim)["elapsed_time_s"])

    assert len({elapsed_s(values) for values in ({}, *({name: value} for name, value in facts.items()))}) == 6


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"frction": 1}', 'unknown parameter "frction"; did you mean "friction"?'),
        ('{"friction": "low"}', "friction: 'low' is not a number"),
        ('{"friction": 100}', "friction: 100 is outside"),
        ('{"com_y_m": 1}', "com_y_m: 1 is outside -0.05 to 0.05 (m)"),
        ('{"wheel_camber_rad": 0.03}', "wheel_camber_rad: multibody has no such tyres; --engine mujoco has them"),
        ("[1]", "is not a JSON object"),
    ],
)
def test_a_mistake_in_a_reality_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "reality.json"
    file.write_text(text)

    with pytest.raises(FoldcarError) as caught:
        read_reality(file, "multibody")

    assert str(file) in str(caught.value) and message in str(caught.value) and "\n" not in str(caught.value)


def test_realities_of_one_name_are_experiments_of_their_own(
    tmp_path: Path, write_listing: Any, listing_data: Any, foldcar: Any
) -> None:
    listing_data["experiments"]["1"]["params"]["environments"] = 1
    listing, store = write_listing(listing_data), tmp_path / "s.db"
    for folder, height in ((tmp_path, 1.25), (tmp_path / "other", 1.2)):
        folder.mkdir(exist_ok=True)
        (folder / "pub.json").write_text(json.dumps({"obstacle_height": height}))

    for words in (("--reality", "pub.json"), ("--reality", "other/pub.json")):
        swept = foldcar("sweep", listing, "--store", store, "--jobs", "1", *words)
        assert swept.returncode == 0 and swept.stdout.startswith("2 new runs"), swept.stderr

    with Store.open(store) as opened:
        infos = opened.info().experiments
    for name in infos:
        assert name.startswith("1 (reality pub ") and infos[name].under == name[3:-1]
        assert infos[name].listed_id == "1"
    assert len(infos) == 2
