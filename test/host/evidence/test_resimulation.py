"""What a sweep lacks is simulated for a comparison: trials as placed, designs with trials only, varied cars."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from foldcar.evidence.resimulation import Case, Resimulation
from foldcar.simulation.carsim import Carsim, CarsimLimits
from foldcar.simulation.runner import RunRequest
from foldcar.store.reader import Store
from foldcar.store.tables import BY_NAME
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, write_trials
from live_car import write_free_course
from study_car import car_body
from swept_listing import json_output, swept


def compare(*words: Any) -> dict[str, Any]:
    return json_output("compare", *words)


@pytest.fixture(scope="module")
def free_course(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A swept study of two widths in two environments without obstacles, which all runs pass."""
    listing = write_free_course(tmp_path_factory.mktemp("free"))
    swept(listing, listing.parent / "s.db", carsim_binary, 1)
    return listing.parent / "s.db"


def test_what_the_sweep_lacks_is_simulated_as_it_was_placed(tmp_path: Path, free_course: Path) -> None:
    free_course = Path(shutil.copy(free_course, tmp_path))
    with Store.open(free_course) as opened:
        drawn = next(opened.rows(BY_NAME["body"], "WHERE id = 1")), next(opened.rows(BY_NAME["settings"], "WHERE id = 1"))
        scene = json.loads(next(opened.rows(BY_NAME["scene"], "WHERE id = 1"))["json"])
        design = dict(opened.designs("1")[0])
        print_of = next(opened.rows(BY_NAME["environment"]))["fingerprint"]
    body, settings = (json.loads(row["json"]) for row in drawn)
    # Turned away from the goal, the car cannot pass.
    turned = {**scene, "start": {**scene["start"], "heading_rad": scene["start"]["heading_rad"] + 3.0}}
    with write_trials(free_course) as writer:
        drive = Drive(body, settings, turned, print_of, "free.scenic", 0)
        facts = CarFacts("fw", "hash", "/dev/null", "built")
        number = writer.begin("1", TrialDesign("W_B_W", design), drive, {"car": (0, 0, 3.0)}, facts, "log", "Ada")
        writer.complete(number, Ending("timeout", "time limit", 3.0, "", None))
        other = {"experiment": "1", "vehicle_type": "W_B_W", "outcome": "passed", "source": "x", "car": "built"}
        for changed in ({"width_mm": 100.0}, {"wit_mm": 3.0}, {"width_mm": 10.0}):
            writer.import_trials([{**other, "uuid": str(changed), "design": {**design, **changed}}])

    (experiment,) = compare(free_course)["experiments"]

    as_swept, new, *cannot = experiment["designs"]
    assert (as_swept["simulated"]["value"], as_swept["paired"], as_swept["agreeing"]) == (1.0, 1, 1)
    assert (new["design"]["width_mm"], new["swept"], new["runs"], new["simulated"]["value"]) == (100, False, 2, 1.0)
    assert any("simulated again as placed" in remark for remark in experiment["remarks"])
    assert any(
        "100 mm is not in the sweep: it was simulated now, in 2 environments" in remark
        for remark in experiment["remarks"]
    )
    assert [(design["runs"], design["simulated"], design["gap"]) for design in cannot] == [(0, None, None)] * 2
    narrow, unknown = (remark for remark in experiment["remarks"] if "cannot be simulated now" in remark)
    assert unknown.endswith("cannot be simulated now: no module has the parameter wit_mm.")
    assert "width" in narrow.partition("cannot be simulated now: ")[2]


def test_of_many_designs_that_the_sweep_lacks_a_bounded_number_is_simulated(
    tmp_path: Path, free_course: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Path(shutil.copy(free_course, tmp_path))
    with Store.open(store) as opened:
        design = dict(opened.designs("1")[0])
    other = {"experiment": "1", "vehicle_type": "W_B_W", "outcome": "passed", "source": "x", "car": "built"}
    widths = [*(90.0 + k for k in range(11) if k != 5), 97.0]
    with write_trials(store) as writer:
        trials = [{**other, "uuid": str(at), "design": {**design, "width_mm": width}} for at, width in enumerate(widths)]
        writer.import_trials(trials)
    made = []
    run = Carsim.run
    monkeypatch.setattr(Carsim, "run", lambda *words: made.append(words) or run(*words))
    monkeypatch.setattr("foldcar.evidence.resimulation.MAX_RUNS", 4)

    (experiment,) = compare(store)["experiments"]

    runs = {design["design"]["width_mm"]: design["runs"] for design in experiment["designs"] if not design["swept"]}
    assert list(runs) == widths[:-1] and len(made) == 2
    # The one with most trials, and the first of the rest.
    assert {width for width, number in runs.items() if number} == {97.0, 90.0}
    assert "97 mm is not in the sweep: it was simulated now, in 2 environments." in experiment["remarks"]
    many = "91 mm, 92 mm, 93 mm, 94 mm, 96 mm and 3 further designs are not in the sweep, and cannot be simulated now: "
    assert any(remark == f"{many}no more than 4 runs are made at a time; sweep it." for remark in experiment["remarks"])


def test_what_is_simulated_now_is_the_car_as_it_varied_then(carsim_limits: CarsimLimits) -> None:
    body = car_body()
    simulated: list[Any] = []

    def answers(bodies: dict[str, str], scenes: dict[str, str], requests: list[RunRequest]) -> list[dict[str, Any]]:
        simulated.extend((bodies[request.body], scenes[request.scene], request.reality) for request in requests)
        return [{"outcome": "passed", "elapsed_time_s": 2.0}, {"error": "no"}]

    carsim: Any = SimpleNamespace(limits=lambda: carsim_limits, run=answers, build="a build of this test")
    unread: Any = None
    cases = [Case({}, "as drawn"), Case({"mass": 0.1}, "heavier")]

    ended = Resimulation(unread)._run(carsim, json.dumps(body), cases, "{}")

    assert ended == [("passed", 2.0), ("failed", None)]
    # What was run once is not run again.
    assert Resimulation(unread)._run(carsim, json.dumps(body), cases[:1], "{}") == ended[:1]
    assert simulated == [(json.dumps(body), "as drawn", "{}"), (json.dumps(body), "heavier", '{"mass":0.1}')]
