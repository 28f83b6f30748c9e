"""`foldcar link --reality`: a simulated car and ground that differ from what the host believes, by named parameters."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from foldcar.commands.listed_run import listed_run, simulated_run
from foldcar.errors import FoldcarError
from foldcar.inference.calibration.environment import read_reality, real_run
from foldcar.inference.calibration.parameters import NOMINAL
from foldcar.store.calibrations import new_calibration, write_calibrations
from foldcar.store.reader import Store

LISTING = Path(__file__).resolve().parents[3] / "scenarios" / "width_study.json"


def test_a_reality_changes_what_it_names_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "reality.json"
    file.write_text('{"obstacle_height": 1.3, "servo_torque": 0.6, "track_m": 0.016}')
    run = listed_run(LISTING, "1", ["width=95"], 3)

    values = read_reality(file, "multibody")
    body, scene = real_run(run.experiment, run.nominal, run.scene, values, 3, run.carsim.limits().numbers)

    assert {name for name, value in values.items() if value != NOMINAL[name]} == {
        "obstacle_height",
        "servo_torque",
        "track_m",
    }
    assert scene["friction"] == run.scene["friction"] and scene["start"] == run.scene["start"]
    believed_heights = [piece["height_m"] for piece in run.scene["terrain"]]
    heights = [piece["height_m"] for piece in scene["terrain"]]
    assert heights and heights == pytest.approx([1.3 * height for height in believed_heights], rel=1e-8)
    assert body["track_m"] == pytest.approx(run.nominal["track_m"] + 0.016)
    torques = [wheel["servo"]["stall_torque_n_m"] for wheel in body["wheels"]]
    believed_torques = [wheel["servo"]["stall_torque_n_m"] for wheel in run.nominal["wheels"]]
    assert torques == pytest.approx([0.6 * torque for torque in believed_torques])
    assert body["segments"] == run.nominal["segments"]


def test_what_the_host_believes_may_be_the_truth(tmp_path: Path) -> None:
    """Some nominal values, as no differences between wheels, are the end of what may be."""
    file = tmp_path / "reality.json"
    file.write_text(json.dumps(dict(NOMINAL)))

    assert read_reality(file, "multibody") == NOMINAL


def test_what_no_calibration_knows_reaches_the_car_in_mujoco(tmp_path: Path) -> None:
    """Camber, soft tyres, a centre of mass aside and ahead, a supply that sags: each makes another run."""
    listed = listed_run(LISTING, "1", ["width=95"], 3, "mujoco")
    facts = {"wheel_camber_rad": -0.035, "tyre_contact_time_s": 0.02, "com_x_m": 0.004, "com_y_m": 0.006,
            "supply_resistance_ohm": 0.4}  # fmt: skip
    file = tmp_path / "reality.json"

    def car(values: dict[str, float]) -> dict[str, Any]:
        file.write_text(json.dumps(values))
        real = read_reality(file, "mujoco")
        assert real == {**NOMINAL, **values}
        return real_run(listed.experiment, listed.nominal, listed.scene, real, 3, listed.carsim.limits().numbers)[0]

    body = car(facts)

    (segment,), (nominal,) = body["segments"], listed.nominal["segments"]
    moved = [segment[key] - nominal[key] for key in ("com_x_m", "com_y_m")]
    assert moved == pytest.approx([0.004, 0.006])
    assert {(wheel["camber_rad"], wheel["contact_time_s"]) for wheel in body["wheels"]} == {(-0.035, 0.02)}
    assert body["supply_resistance_ohm"] == 0.4
    run, _ = simulated_run(listed)
    elapsed_s = {replace(run, body=car(values)).simulate(listed.carsim)["elapsed_time_s"]
                 for values in ({}, *({name: facts[name]} for name in facts))}  # fmt: skip
    assert len(elapsed_s) == 6


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


def test_realities_of_one_name_and_a_calibration_of_it_are_experiments_of_their_own(
    tmp_path: Path, write_listing: Any, listing_data: Any, foldcar: Any
) -> None:
    listing_data["experiments"]["1"]["params"]["environments"] = 1
    listing, store = write_listing(listing_data), tmp_path / "s.db"
    with write_calibrations(store) as writer:
        draw, summary = {**NOMINAL, "obstacle_height": 0.5}, {"findings": []}
        writer.put(new_calibration("pub", "1", "build", [draw], summary), replace=False)
    for folder, height in ((tmp_path, 1.25), (tmp_path / "other", 1.2)):
        folder.mkdir(exist_ok=True)
        (folder / "pub.json").write_text(json.dumps({"obstacle_height": height}))

    for words in (("--calibration", "pub"), ("--reality", "pub.json"), ("--reality", "other/pub.json")):
        swept = foldcar("sweep", listing, "--store", store, "--jobs", "1", *words)
        assert swept.returncode == 0 and swept.stdout.startswith("2 runs new"), swept.stderr

    with Store.open(store) as opened:
        infos = opened.info().experiments
    calibrated, *real = infos
    assert calibrated == "1 (calibrated pub)" and infos[calibrated].under == "calibration pub"
    for name in real:
        assert name.startswith("1 (reality pub ") and infos[name].under == name[3:-1]
        assert infos[name].listed_id == "1"
    assert len(set(real)) == 2
