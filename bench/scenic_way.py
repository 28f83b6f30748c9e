"""Measures Scenic's cost: a run of 120 s with Scenic against the same run without, and sampling many objects.

Input: the simulator. Output: processor time of this thread (ms), without the simulator's process; each value is the
minimum of several measurements, because other load only adds time. The process's own clock advances in ticks of some
ms once its processor time has been limited, as sampling does.
"""

import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json, firmware_parameters
from foldcar.car.design import compose
from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim_step import SteppedCarsim
from foldcar.simulation.scenic_simulator import CarSimulator

RUN_S = 120.0
REPEATS = 7
OBJECTS = 50
# A slow car on a wide course, which a car with an eccentric centre of mass does not leave; a condition and a record.
SPEED_M_S = 0.1
LONG_WAY = """model model
param course_x_max = 20, course_y_min = -5, course_y_max = 5
ego = new Robot at (0, 0), facing -90 deg
terminate when ego.position.x > 19
record final ego.position.x as way
"""
# Programs are read again when they are drawn from.
PROGRAMS = tempfile.TemporaryDirectory()
# Specifiers of the objects' orientation, by their names in the table.
TURNS = {
    "headings given": "facing 90 deg",
    "random yaw": "with yaw Range(0, 180) deg",
    "facing at random": "facing Range(0, 180) deg",
}
MANY = f"""model model
ego = new Robot at (0, 0), facing -90 deg
new Goal at (1.8, 0), facing -90 deg
for _ in range({OBJECTS - 2}):
    new Bump at (Range(0.3, 1.5), Range(-0.8, 0.8)), TURN, with height Range(0.005, 0.02), with allowCollisions True
"""


def scenic_run_ms(binary: Path) -> float:
    """The processor time (ms) that Scenic adds to a run of 120 s."""
    source = _source(LONG_WAY)
    scene = source.scenic_scene(0)
    text = json.dumps(source.describe(scene, 0))
    design = compose("W_B_W", {})
    body = body_json(design)
    settings = {
        "speed_m_s": SPEED_M_S,
        "yaw_rate_rad_s": 0.0,
        "time_limit_s": RUN_S,
        "parameters": {**firmware_parameters(design, body), "TRIAL_MAX_S": RUN_S},
    }
    car = json.dumps(body), json.dumps(settings)
    with SteppedCarsim([str(binary)]) as carsim:
        simulator = CarSimulator(carsim, *car, lambda _: text)

        def alone() -> Any:
            carsim.start(car[0], text, car[1])
            return carsim.advance(2 * RUN_S).result

        beside = simulator.run(scene)
        assert {**beside, "recorded": {}} == {**alone(), "recorded": {}}
        assert beside["elapsed_time_s"] >= RUN_S
        with_scenic, without = _least_ms(lambda: simulator.run(scene), alone)
    return with_scenic - without


def sampling_ms(turn: str) -> float:
    """The processor time (ms) to sample a scene of 50 objects with that specifier, without converting it to JSON."""
    source = _source(MANY.replace("TURN", TURNS[turn]))
    samples = iter(range(10_000))
    (least,) = _least_ms(lambda: source.scenic_scene(next(samples)))
    return least


def _source(text: str) -> Any:
    program = Path(tempfile.mkdtemp(dir=PROGRAMS.name), "program.scenic")
    program.write_text(text)
    return open_environment(program, {}, 1)


def _least_ms(*actions: Callable[[], Any]) -> list[float]:
    least = [float("inf")] * len(actions)
    for _ in range(REPEATS):
        for i, action in enumerate(actions):
            start_s = time.thread_time()
            action()
            least[i] = min(least[i], 1000 * (time.thread_time() - start_s))
    return least
