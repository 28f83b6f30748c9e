"""The speed of MuJoCo from Python, as its users would write it: the exported model of a car, stepped in a loop.

Input: a store of a sweep. Output: simulated seconds a second of processor time.
Without the firmware: servos get full drive.
"""

import json
import sqlite3
import time
from pathlib import Path

import mujoco

from foldcar.models.mjcf import mjcf
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO


def python_factor(store: Path) -> float:
    """Every run of the store, as long as it took there, with a look at the car's place after each step."""
    connection = sqlite3.connect(f"{store.as_uri()}?mode=ro", uri=True)
    runs = connection.execute(
        "SELECT b.json, s.json, r.elapsed_time_s FROM run r JOIN body b ON b.id = r.body_id "
        "JOIN scene s ON s.id = r.scene_id WHERE r.elapsed_time_s IS NOT NULL"
    ).fetchall()
    connection.close()
    carsim, simulated_s, processor_s = Carsim(engine=MUJOCO), 0.0, 0.0
    for body, scene, elapsed_s in runs:
        parsed = json.loads(scene)
        model = mujoco.MjModel.from_xml_string(mjcf(carsim, json.loads(body), parsed))
        data = mujoco.MjData(model)
        start_s = time.process_time()
        data.ctrl[:] = 1.0
        furthest_m = parsed["course"]["x_max_m"]
        while data.time < elapsed_s and data.qpos[0] < furthest_m:
            mujoco.mj_step(model, data)
        processor_s += time.process_time() - start_s
        simulated_s += data.time
    return simulated_s / processor_s
