"""Calibration: priors, effects on runs, information against closed forms; the command, its store, sweeps."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, halfnorm, lognorm, norm

from foldcar.belief.priors import NAMES, NOMINAL, PARAMETERS, ScorePrior, built_priors, prior_interval
from foldcar.belief.reality import drawn_reality
from foldcar.car.variation import draw, workshop
from foldcar.errors import FoldcarError
from foldcar.inference.calibration.experiment import read_experiment
from foldcar.inference.calibration.observations import observe
from foldcar.inference.calibration.predictions import fraction_interval
from foldcar.store.calibrations import Calibration, calibration_named
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.tables import BY_NAME
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, write_trials
from forked_foldcar import original
from full_store import alter
from study_car import listing_of

BUMP = """model model
param height = 0.03
ego = new Robot at (0, Normal(0, 0.01)), facing Normal(-90 deg, 0.02)
bump = new Bump at (0.25, 0), facing -90 deg, with height globalParameters.height
goal = new Goal at (0.45, 0), facing -90 deg
"""

TRIALS = """experiment,vehicle_type,radius_mm,outcome,count,source
1,W_B_W,40,not_passed,8,a paper
1,W_B_W,48,not_passed,8,a paper
"""

DRAWS = 100


def test_a_standard_normal_score_has_the_declared_prior() -> None:
    scores = np.array([-2.5, -1.0, 0.0, 0.7, 3.0])
    for parameter in PARAMETERS:
        prior: Any = {
            "log-normal": lognorm(parameter.sd, scale=parameter.middle or 1),
            "normal": norm(parameter.middle, parameter.sd),
            "half-normal": halfnorm(scale=parameter.sd),
        }[parameter.prior]
        values = parameter.value(scores)
        assert values == pytest.approx(prior.ppf(norm.cdf(scores)))
        assert [parameter.score(value) for value in values] == pytest.approx(list(scores))


def test_a_reality_has_the_values_and_random_parts_that_all_values_share() -> None:
    values = {**NOMINAL, "friction": 0.5, "servo_torque": 0.7, "servo_speed": 1.2, "obstacle_height": 1.5}
    values |= {"com_height_m": 0.01, "track_m": 0.016}

    reality = drawn_reality(values, {}, 1, 2, 2)

    assert {name: reality[name] for name in ("friction", "obstacle_height", "com_z_m", "track_m")} == {
        "friction": 0.5, "obstacle_height": 1.5, "com_z_m": 0.01, "track_m": 0.016,
    }  # fmt: skip
    assert reality["servo_torque"] == pytest.approx([-0.3] * 8) and reality["servo_speed"] == pytest.approx([0.2] * 8)
    assert (reality["start_x_m"], reality["start_heading_rad"]) == (0, 0)
    wide = {**values, "start_position_sd_m": 0.02, "start_heading_sd_rad": 0.1, "wheel_spread": 2.0}
    starts = [drawn_reality(wide, {}, 5, k, k) for k in range(2000)]
    names = ("start_x_m", "start_y_m", "start_heading_rad")
    assert [np.std([start[name] for start in starts]) for name in names] == pytest.approx([0.02, 0.02, 0.1], rel=0.08)
    half = drawn_reality({**wide, "start_heading_sd_rad": 0.05}, {}, 5, 7, 7)
    assert half["start_heading_rad"] == pytest.approx(starts[7]["start_heading_rad"] / 2)
    assert half["start_x_m"] == starts[7]["start_x_m"]
    # The listing's own spreads of the whole car stay, those of wheels give way.
    varied = drawn_reality(wide, {"mass": 0.03, "tyre_grip": 0.5}, 5, 7, 7)
    doubled = draw({name: 2 * workshop()[name].sd for name in ("tyre_grip", "servo_torque")} | {"mass": 0.03}, 5, 7)
    assert varied["tyre_grip"] == pytest.approx(doubled["tyre_grip"]) and varied["mass"] == doubled["mass"]
    # A servo has its own part of what all servos have.
    torques = [1 + difference for difference in varied["servo_torque"]]
    assert torques == pytest.approx([0.7 * (1 + difference) for difference in doubled["servo_torque"]])


def test_shares_of_trials_have_the_quantiles_of_their_count() -> None:
    chances = np.tile(binom.logpmf(np.arange(11), 10, 0.3), (100, 1))

    assert fraction_interval(chances, 0.9) == (binom.ppf(0.05, 10, 0.3) / 10, binom.ppf(0.95, 10, 0.3) / 10)


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a listing, trials, and the store s.db in which it was swept and calibrated."""
    folder = tmp_path_factory.mktemp("calibration")
    (folder / "bump.scenic").write_text(BUMP)
    listing = listing_of("bump.scenic", {"radius": [40, 48]}, seed=1, timeout=1.5, environments=20)
    (folder / "l.json").write_text(json.dumps(listing))
    (folder / "t.csv").write_text(TRIALS)
    run(folder, "sweep", "l.json", "--store", "swept.db")
    shutil.copy(folder / "swept.db", folder / "s.db")
    run(folder, "trials", "import", "s.db", "t.csv")
    answer = run(folder, "calibrate", "s.db", "--name", "mine", "--runs", "500", "--known", "track_m=0", "--json")
    (folder / "told.json").write_text(answer.stdout)
    return folder


def run(folder: Path, *words: str, code: int = 0) -> Any:
    """The command, run in the folder."""
    answer = original().run(list(words), folder)
    assert answer.returncode == code, answer.stderr
    return answer


def test_trials_that_fail_raise_obstacles_and_predict_failures(swept: Path) -> None:
    output = json.loads((swept / "told.json").read_text())

    high = next(parameter for parameter in output["parameters"] if parameter["name"] == "obstacle_height")
    assert high["posterior"]["median"] > 1.15 * high["prior"]["median"] and high["explained"] > 0.1
    for design in output["designs"]:
        assert design["simulated"]["median"] < design["nominal"] or design["nominal"] < 0.2
        assert design["predicted"]["low"] == 0 and design["built"]["low"] < 0.2
    assert output["log_likelihood"]["best"] == 0 > output["log_likelihood"]["draws"] > output["log_likelihood"]["nominal"]
    assert any("None of the 16 trials passed" in note for note in output["notes"])
    assert len(output["draws"]) == DRAWS and all(set(draw) == set(NAMES) for draw in output["draws"])
    # What was measured is known, not inferred.
    assert all(draw["track_m"] == pytest.approx(0, abs=1e-9) for draw in output["draws"])
    assert not any("track_m" in pair["parameters"] for pair in output["correlations"])
    assert (
        "Measuring often tells more than trials: obstacle_height and com_height_m (`foldcar trials measure`)."
        in output["findings"]
    )


def test_only_cars_that_were_built_from_the_sheets_have_their_prior(swept: Path, tmp_path: Path) -> None:
    store = Path(shutil.copy(swept / "swept.db", tmp_path / "s.db"))

    def com_height_prior(simulated: bool) -> list[float]:
        with Store.open(store) as opened:
            observed = observe(opened, read_experiment(opened, "1"), simulated)
        index = NAMES.index("com_height_m")
        prior = built_priors("W_B_W", observed.from_sheets).get(index, ScorePrior(0.0, 1.0, ""))
        return list(prior_interval(PARAMETERS[index], prior))

    with Store.open(store) as opened:
        parameters = [dict(design) for design in opened.designs("1").values()]
        scene = json.loads(next(opened.rows(BY_NAME["scene"]))["json"])
        place = next(opened.rows(BY_NAME["environment"]))["fingerprint"]
        body, settings = (json.loads(next(opened.rows(BY_NAME[name]))["json"]) for name in ("body", "settings"))
    for car in ("built", "simulated"):
        with write_trials(store) as writer:
            drive = Drive(body, settings, scene, place, "bump.scenic", 0)
            facts = CarFacts("fw", "hash", "/dev/null", car)
            for design in parameters:
                number = writer.begin("1", TrialDesign("W_B_W", design), drive, {}, facts, "log", "Ada")
                writer.complete(number, Ending("timeout", "time limit", 1.5, "", None))

    driven, rehearsed = com_height_prior(simulated=False), com_height_prior(simulated=True)
    shutil.copy(swept / "t.csv", tmp_path)
    run(tmp_path, "trials", "import", "s.db", "t.csv")
    with_imported = com_height_prior(simulated=False)

    assert driven == pytest.approx([-0.004935, 0, 0.004935], abs=1e-6)
    assert rehearsed[1] == with_imported[1] == pytest.approx(0.01)


def test_measured_values_are_kept_and_taken_as_known(swept: Path, tmp_path: Path) -> None:
    shutil.copy(swept / "s.db", tmp_path)

    before = run(tmp_path, "trials", "measure", "s.db")
    run(tmp_path, "trials", "measure", "s.db", "track_m=0.5e-2", "obstacle_height=1.1", "friction=0.9")
    kept = run(tmp_path, "trials", "measure", "s.db", "track_m=0.002", "friction=")
    answer = run(
        tmp_path, "calibrate", "s.db", "--name", "two", "--runs", "500", "--known", "obstacle_height=1.05", "--json"
    )
    shown = run(tmp_path, "calibrate", "s.db", "--name", "three", "--runs", "500").stdout

    assert before.stdout == "experiment 1: no measured values\n"
    assert kept.stdout == "experiment 1: obstacle_height 1.1 ×\nexperiment 1: track_m 0.002 m\n"
    draws = json.loads(answer.stdout)["draws"]
    rows = [line.split() for line in shown.splitlines()]
    assert ["obstacle_height", "(×)", "1.1", "1.1", "-"] in rows and ["track_m", "0.002", "0.002", "-"] in rows
    # The command's value goes before the kept one.
    assert {(draw["track_m"], draw["obstacle_height"]) for draw in draws} == {(0.002, 1.05)}
    assert len({draw["friction"] for draw in draws}) > 10


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("track_m=0.5",), "trials measure: track_m: 0.5 is outside -0.01 to 0.01 (m)"),
        (("track=0",), 'trials measure: track: unknown parameter "track"'),
        (("track=",), "trials measure: track=: unknown parameter; known: friction, "),
        (("track_m=wide",), "trials measure: track_m=wide: is not NAME=VALUE with a number"),
        (("track_m=0", "track_m=0.001"), "trials measure: track_m: is given twice"),
        (("track_m=0", "--experiment", "3"), 's.db: has no experiment "3"; it has 1'),
    ],
)
def test_wrong_measurements_are_refused(swept: Path, words: tuple[str, ...], message: str) -> None:
    before = (swept / "s.db").read_bytes()

    refused = run(swept, "trials", "measure", "s.db", *words, code=2)

    assert refused.stderr.count("\n") == 1 and message in refused.stderr, refused.stderr
    assert (swept / "s.db").read_bytes() == before


def test_a_damaged_measurement_is_refused_by_the_calibration(swept: Path, tmp_path: Path) -> None:
    shutil.copy(swept / "s.db", tmp_path)
    alter(tmp_path / "s.db", "INSERT INTO measured VALUES ('1', 'track_m', 0.3)")

    refused = run(tmp_path, "calibrate", "s.db", "--name", "two", "--runs", "500", code=2)

    assert "s.db: measured track_m: 0.3 is outside -0.01 to 0.01 (m)" in refused.stderr


def calibration(folder: Path, name: str = "mine", store: str = "s.db") -> Calibration:
    with Store.open(folder / store) as opened:
        return calibration_named(opened, name)


def test_a_sweep_under_a_calibration_takes_its_draws_and_leaves_nominal_runs(swept: Path) -> None:
    store = swept / "swept_under.db"
    shutil.copy(swept / "s.db", store)
    sweep = ["sweep", "l.json", "--store", store.name, "--calibration", "mine", "--samples", "3"]
    first, second = run(swept, *sweep), run(swept, *sweep)

    assert first.stdout.startswith("6 new runs") and second.stdout.startswith("0 new runs, 6 already")
    draws = calibration(swept).draws
    with Store.open(store) as opened:
        info = opened.info().experiments
        assert [len(list(opened.results(name))) for name in ("1", "1 (calibrated mine)")] == [40, 6]
        under = read_drives(opened, "1 (calibrated mine)")
        realities = [under.value("variation", under.variations[k]) for k in range(3)]
        assert under.scenes == {k: read_drives(opened, "1").scenes[k] for k in range(3)}
    assert info["1"].calibration is None
    assert info["1 (calibrated mine)"].calibration == {
        "name": "mine", "fingerprint": calibration(swept).fingerprint, "experiment": "1",
    }  # fmt: skip
    for k, reality in enumerate(realities):
        assert reality["obstacle_height"] == draws[k]["obstacle_height"] and reality["friction"] == draws[k]["friction"]
    refused = run(swept, "calibrate", store.name, "--experiment", "1 (calibrated mine)", code=2)
    assert "has no trials of experiment" in refused.stderr
    kept = run(swept, "calibrate", store.name, "--name", "mine", "--replace", code=2)
    assert 'calibration "mine": experiment "1 (calibrated mine)" was swept with it; choose another' in kept.stderr


CSV = "experiment,vehicle_type,radius_mm,outcome,count,source,car\n"


@pytest.mark.parametrize(
    ("trials", "options", "message"),
    [
        ("", (), "holds no trials: drive some"),
        ("1,W_B_W,40,passed,3,x,simulated", (), "no trial to calibrate by: 3 of simulated cars (--simulated-trials"),
        ("1,W_B_W,33,passed,3,x,built", (), "3 of cars whose design was not swept"),
        ("2,W_B_W,40,passed,3,x,built", (), "experiment 2: was not swept into this store, which has 1"),
        ("1,W_B_W,40,passed,3,x,built\n2,W_B_W,40,passed,3,y,built", (), "has trials of experiments 1, 2: choose one"),
        ("", ("--name", "a b"), '--name "a b": a name is at most 40 letters'),
        ("", ("--known", "friction=9"), "--known friction: 9 is outside 0.472 to 2.12 (×)"),
    ],
)
def test_trials_that_say_nothing_are_refused_in_a_sentence(
    swept: Path, tmp_path: Path, trials: str, options: tuple[str, ...], message: str
) -> None:
    shutil.copy(swept / "swept.db", tmp_path / "s.db")
    if trials:
        (tmp_path / "t.csv").write_text(CSV + trials + "\n")
        run(tmp_path, "trials", "import", "s.db", "t.csv")
    before = (tmp_path / "s.db").read_bytes()

    refused = run(tmp_path, "calibrate", "s.db", *options, code=2)

    assert refused.stderr.count("\n") == 1 and message in refused.stderr, refused.stderr
    assert (tmp_path / "s.db").read_bytes() == before


def test_names_are_given_once_and_unknown_ones_refused(swept: Path) -> None:
    taken = run(swept, "calibrate", "s.db", "--name", "mine", code=2)
    unknown = run(swept, "sweep", "l.json", "--store", "s.db", "--calibration", "none", code=2)

    assert 's.db: already has a calibration "mine"; choose another --name, or use --replace' in taken.stderr
    assert 's.db: has no calibration "none"; it has' in unknown.stderr
    with Store.open(swept / "swept.db") as opened, pytest.raises(FoldcarError, match="make one with `foldcar calibrate`"):
        calibration_named(opened, "mine")
