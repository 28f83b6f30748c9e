"""MCAP files: every message conforms to its schema, times are the car's, the scene stands where the solids are."""

import json
import math
from pathlib import Path
from typing import Any

import numpy
import pytest
from mcap.reader import make_reader

from foldcar.link.dialect import load_dialect
from foldcar.link.mcap_export import export_mcap
from foldcar.link.tlog import TlogWriter
from foldcar.models.foxglove_scene import foxglove_scene
from foldcar.models.ground import smooth_ground
from study_car import car_body, empty_scene

START_US = 1_750_000_000_000_000
BLOCK = {"x_m": 1.0, "y_m": 0.1, "heading_rad": 0.3, "length_m": 0.4, "width_m": 0.6, "height_m": 0.05}


def conforms(value: Any, schema: dict[str, Any]) -> bool:
    """Whether a JSON value has the types and fields of a JSON schema, those that are written here."""
    kinds = {"object": dict, "array": list, "string": str, "integer": int, "number": int | float, "boolean": bool}
    if not isinstance(value, kinds[schema["type"]]):
        return False
    if isinstance(value, list):
        return all(conforms(item, schema["items"]) for item in value)
    if not isinstance(value, dict) or "properties" not in schema:
        return True
    properties = schema["properties"]
    return set(schema.get("required", ())) <= set(value) <= set(properties) and all(
        conforms(item, properties[name]) for name, item in value.items()
    )


def truth(t_s: float, x_m: float, pitch_rad: float = 0.0) -> Any:
    """The simulator's message, without a goal."""
    nan = math.nan
    return load_dialect().MAVLink_foldcar_truth_message(
        round(1e6 * t_s), x_m, 0.2, 0.06, 0.3, pitch_rad, 0.1, 0.5, 0.0, nan, 1, nan, 0
    )


def write_log(file: Path, rows: list[tuple[float, int, int, Any]]) -> Path:
    """A log of messages, each with the host's time (s), system and component."""
    dialect = load_dialect()
    writer = TlogWriter(file)
    for host_s, system, component, message in rows:
        sender = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        writer.write(message.pack(sender), START_US + round(1e6 * host_s))
    writer.close()
    return file


def read(file: Path) -> list[tuple[str, float, Any, dict[str, Any]]]:
    """Topic, time (s since the start), content and schema of each message."""
    with file.open("rb") as opened:
        return [
            (channel.topic, message.log_time / 1e9 - START_US / 1e6, json.loads(message.data), json.loads(schema.data))
            for schema, channel, message in make_reader(opened).iter_messages()
            if schema is not None
        ]


def test_every_message_conforms_to_its_schema(tmp_path: Path) -> None:
    log = write_log(tmp_path / "t.tlog", [(0.0, 1, 25, truth(1.0, 0.0)), (0.1, 1, 25, truth(1.1, 0.1))])
    pieces = [{"kind": kind, **BLOCK} for kind in ("box", "ramp", "half_round")]
    scene = empty_scene(pieces)
    rough = {**scene, "terrain": [{"kind": "rough", **BLOCK}]}
    grid = smooth_ground(rough, lambda _, x, y: 0.01 * numpy.sin(20 * x))
    count = export_mcap(log, tmp_path / "t.mcap", {}, foxglove_scene(car_body(), scene, grid), scene["start"])

    rows = read(tmp_path / "t.mcap")
    assert count == 2 and {topic for topic, *_ in rows} == {"/scene", "/tf", "/simulator/FOLDCAR_TRUTH"}
    truths = [content for topic, _, content, _ in rows if topic == "/simulator/FOLDCAR_TRUTH"]
    assert all("distance_to_target" not in content and "x" in content for content in truths)
    for topic, _, content, schema in rows:
        # A pose that is not known is none; MAVLink's messages have no fields that must be there.
        assert conforms(content, schema), topic
    assert len([topic for topic, *_ in rows if topic == "/tf"]) == 3


@pytest.mark.parametrize("rate", [0.1, 20.0])
def test_times_are_the_cars_at_any_rate_of_the_simulation(tmp_path: Path, rate: float) -> None:
    dialect = load_dialect()
    rows = [(0.02 * i / rate, 1, 25, truth(5 + 0.02 * i, 0.01 * i)) for i in range(101)]
    # The host's heartbeats have no time of the car's.
    rows += [(0.5 * i / rate, 255, 1, dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)) for i in range(5)]
    log = write_log(tmp_path / "t.tlog", sorted(rows, key=lambda row: row[0]))
    export_mcap(log, tmp_path / "t.mcap", {})

    messages = read(tmp_path / "t.mcap")
    simulated = [(t, content["x"]) for topic, t, content, _ in messages if topic == "/simulator/FOLDCAR_TRUTH"]
    beats = [t for topic, t, *_ in messages if topic == "/host/HEARTBEAT"]
    assert [t for t, _ in simulated] == pytest.approx([0.02 * i for i in range(101)], abs=1e-3)
    # The car drives 0.5 m/s by its own clock.
    assert (simulated[-1][1] - simulated[0][1]) / (simulated[-1][0] - simulated[0][0]) == pytest.approx(0.5, rel=1e-3)
    assert beats == pytest.approx([0.5 * i for i in range(5)], abs=0.025)


def test_time_goes_on_after_a_reset(tmp_path: Path) -> None:
    rows = [(0.1 * i, 1, 25, truth(50 + 0.1 * i, 0.0)) for i in range(10)]
    rows += [(2.0 + 0.1 * i, 1, 25, truth(0.3 + 0.1 * i, 1.0)) for i in range(10)]
    export_mcap(write_log(tmp_path / "t.tlog", rows), tmp_path / "t.mcap", {})

    times = [t for topic, t, *_ in read(tmp_path / "t.mcap") if topic == "/simulator/FOLDCAR_TRUTH"]
    assert times == pytest.approx([row[0] for row in rows], abs=1e-3)


def test_the_scene_has_the_cars_and_the_grounds_sizes(tmp_path: Path) -> None:
    body = car_body()
    pieces = [{"kind": kind, **BLOCK} for kind in ("box", "ramp", "half_round")]
    ground, car = foxglove_scene(body, empty_scene(pieces), None)["entities"]

    assert (ground["frame_id"], car["frame_id"]) == ("world", "car")
    assert len(car["cylinders"]) == 4 and len(car["cubes"]) == len(body["segments"])
    tyre = car["cylinders"][0]
    assert tyre["size"]["x"] == 2 * body["wheels"][0]["radius_m"] and tyre["size"]["z"] == body["wheels"][0]["width_m"]
    # Closed, faces outwards: volumes by the divergence theorem.
    radius = (0.2**2 + 0.05**2) / 0.1
    segment = radius**2 * math.asin(0.2 / radius) - 0.2 * (radius - 0.05)
    for triangles, area in zip(ground["triangles"], (0.4 * 0.05, 0.4 * 0.05 / 2, segment), strict=True):
        points = numpy.array([[p["x"], p["y"], p["z"]] for p in triangles["points"]])
        a, b, c = points[numpy.array(triangles["indices"]).reshape(-1, 3)].transpose(1, 0, 2)
        volume = float(numpy.sum(a * numpy.cross(b, c))) / 6
        assert volume == pytest.approx(area * 0.6, rel=0.02)


def test_a_pose_turns_as_the_car_does(tmp_path: Path) -> None:
    log = write_log(tmp_path / "t.tlog", [(0.0, 1, 25, truth(1.0, 0.7, 0.25))])
    export_mcap(log, tmp_path / "t.mcap", {})
    (pose,) = (content for topic, _, content, _ in read(tmp_path / "t.mcap") if topic == "/tf")

    x, y, z, w = (pose["rotation"][axis] for axis in "xyzw")
    forward = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))
    left_up = 2 * (y * z + x * w)
    expected = (math.cos(0.25) * math.cos(0.3), math.cos(0.25) * math.sin(0.3), math.sin(0.25))
    assert forward == pytest.approx(expected, abs=1e-6)
    assert left_up == pytest.approx(math.cos(0.25) * math.sin(0.1), abs=1e-6)
    assert pose["translation"] == pytest.approx({"x": 0.7, "y": 0.2, "z": 0.06})
