"""Writes the inputs that the fuzzers start from: seeds.py FOLDER. Each fuzzer has a folder of its own there."""

import json
import struct
import sys
from pathlib import Path
from typing import Any

from foldcar.car.body import car_json
from foldcar.car.design import compose
from foldcar.link.dialect import load_dialect

GOLDEN = Path(__file__).resolve().parents[1] / "determinism" / "golden_input.jsonl"
PARAMETERS = (
    ("TRACK_M", 0.2),
    ("WHEEL_RADIUS_M", 0.06),
    ("CH1_SIDE", 1.0),
    ("CH8_GAIN_US", 150.0),
    ("TILT_MAX_RAD", 1.2),
)


def sessions() -> dict[str, list[list[dict[str, Any]]]]:
    """Sessions of `carsim batch` and `carsim step`: each body on each scene of the golden input."""
    lines = [json.loads(line) for line in GOLDEN.read_text(encoding="utf-8").splitlines()]
    bodies, scenes, runs = ([line for line in lines if kind in line] for kind in ("body", "scene", "run"))
    pulses = {"pulses": {"id": "p", "speed_m_s": 0.5, "yaw_rate_rad_s": 0.2, "time_limit_s": 1.0, "parameters": {}}}
    batch, step = [], []
    for run in runs:
        chosen = [body for body in bodies if body["body"]["id"] == run["run"]["body"]]
        chosen += [scene for scene in scenes if scene["scene"]["id"] == run["run"]["scene"]]
        points = {"heights": {"id": "h", "scene": run["run"]["scene"], "x_m": [0.3, 0.7], "y_m": [0.0, 0.1]}}
        batch.append([*chosen, {"run": {**run["run"], "parameters": {"TRACK_M": 0.14}}}, points, pulses])
        single = {key: value for key, value in run["run"].items() if key != "path_interval_s"}
        step.append([*chosen, {"run": single}, {"advance": {"to_s": 0.04}}, {"rows": {}}, {"end": {"row": 3}}])
    return {"batch": batch, "step": step}


def packets() -> bytes:
    """What a host sends, in pieces of at most 255 bytes, each after its size and 10 ms."""
    dialect = load_dialect()
    mav = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    messages = [
        mav.heartbeat_encode(6, 8, 0, 0, 0),
        mav.command_long_encode(1, 1, dialect.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0),
        mav.command_long_encode(1, 1, dialect.MAV_CMD_FOLDCAR_START_TRIAL, 0, 0.5, 0, 10, 1, 1, 0, 0),
        mav.command_long_encode(1, 1, dialect.MAV_CMD_ACTUATOR_TEST, 0, 1, 3, 0, 0, 33, 0, 0),
        mav.command_long_encode(1, 1, dialect.MAV_CMD_SET_MESSAGE_INTERVAL, 0, 30, 20000, 0, 0, 0, 0, 0),
        mav.command_long_encode(1, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0),
        mav.manual_control_encode(1, 1000, 0, 0, 0, 0),
        mav.param_request_list_encode(1, 1),
        mav.param_request_read_encode(1, 1, b"", 7),
        mav.param_set_encode(1, 1, b"TRACK_M", 0.2, 9),
        mav.log_request_list_encode(1, 1, 0, 0xFFFF),
        mav.log_request_data_encode(1, 1, 1, 0, 1000),
        mav.ping_encode(1, 1, 0, 0),
    ]
    return b"".join(bytes((len(packed), 50)) + packed for packed in (one.pack(mav) for one in messages))


def main() -> None:
    """Write the files."""
    folder = Path(sys.argv[1])
    seeds = {
        kind: ["".join(json.dumps(line) + "\n" for line in lines).encode() for lines in of_kind]
        for kind, of_kind in sessions().items()
    }
    seeds["design"] = [json.dumps(car_json(compose(kind, {}))).encode() for kind in ("W_B_W", "W_B_B_W")]
    seeds["link"] = [packets()]
    seeds["parameters"] = [b"".join(struct.pack("<16sf", name.encode(), value) for name, value in PARAMETERS)]
    for fuzzer, inputs in seeds.items():
        (folder / fuzzer).mkdir(parents=True, exist_ok=True)
        for number, content in enumerate(inputs):
            (folder / fuzzer / f"seed{number}").write_bytes(content)


if __name__ == "__main__":
    main()
