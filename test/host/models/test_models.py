"""Models for other simulators, read by the simulators' parsers or by a reader of their grammar."""

import json
import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy
import pytest

from foldcar.models.ground import smooth_ground, start_height_m
from foldcar.models.mjcf import mjcf
from foldcar.models.urdf import urdf
from foldcar.models.webots_car import webots_proto
from foldcar.models.webots_world import webots_world
from foldcar.simulation import engines
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO
from foldcar.simulation.runner import CarsimError
from study_car import car_body, empty_scene, hinged_body
from vrml_reader import Reader, ReadNode

POSE = {"x_m": 1.0, "y_m": 0.1, "heading_rad": 0.3}
BLOCK = {**POSE, "length_m": 0.4, "width_m": 0.6, "height_m": 0.05}
either = pytest.mark.parametrize("body", [car_body(), hinged_body()], ids=["rigid", "hinged"])


def mass_and_center(body: dict[str, Any]) -> tuple[float, Any]:
    """Mass (kg) and centre of mass (m, car's frame) of the whole car, computed from its parts."""
    parts = [(s["mass_kg"], (s["com_x_m"], s["com_y_m"], s["com_z_m"])) for s in body["segments"]]
    for wheel in body["wheels"]:
        side = 1 if wheel["side"] == "left" else -1
        off, phase = wheel["eccentricity_m"], wheel["eccentricity_phase_rad"]
        place = (wheel["x_m"] + off * math.cos(phase), side * body["track_m"] / 2, off * math.sin(phase))
        parts.append((wheel["mass_kg"], place))
    mass = sum(part[0] for part in parts)
    return mass, sum(m * numpy.array(place) for m, place in parts) / mass


@either
def test_mjcf_and_urdf_weigh_and_measure_what_the_body_does(native: Carsim, body: dict[str, Any]) -> None:
    mass, center = mass_and_center(body)

    # MuJoCo writes six digits.
    for text, small_m, small in ((mjcf(native, body), 2e-7, 3e-6), (urdf(body, "car"), 1e-9, 1e-6)):
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        origin = data.xpos[1].copy()
        if urdf_names(model):
            assert origin == pytest.approx([0, 0, 0])
        else:
            # Put down on a level floor.
            assert origin == pytest.approx([0, 0, body["wheels"][0]["radius_m"]], abs=2e-3)
        assert model.body_mass.sum() == pytest.approx(mass, rel=small)
        assert data.subtree_com[0] - origin == pytest.approx(center, abs=small_m)
        for index, segment in enumerate(body["segments"]):
            inertia = [segment[f"{axis}_inertia_kg_m2"] for axis in ("roll", "pitch", "yaw")]
            part = model.body(f"segment{index}" if index or not urdf_names(model) else "base_link")
            # The order of principal axes is arbitrary.
            assert sorted(part.inertia) == pytest.approx(sorted(inertia), rel=small)
        for wheel in body["wheels"]:
            part = model.body(f"wheel{wheel['channel']}")
            side = 1 if wheel["side"] == "left" else -1
            place = [wheel["x_m"], side * body["track_m"] / 2, 0]
            assert data.xpos[part.id] - origin == pytest.approx(place, abs=small_m)
            radius, width = wheel["radius_m"], wheel["width_m"]
            spin = wheel["mass_kg"] * radius**2 / 2
            across = wheel["mass_kg"] * (3 * radius**2 + width**2) / 12
            assert sorted(part.inertia) == pytest.approx([across, across, spin], rel=small)
        axle = data.xaxis[model.joint("wheel0_axle").id]
        assert axle == pytest.approx([0, 1, 0], abs=1e-9)
        if body["hinges"]:
            assert model.joint("hinge0").range == pytest.approx([-0.5, 0.4])
            assert data.xanchor[model.joint("hinge0").id] - origin == pytest.approx([0, 0, 0.02], abs=small_m)


def urdf_names(model: Any) -> bool:
    """Whether a model's front segment is called base_link, as in URDF."""
    return "base_link" in {model.body(i).name for i in range(model.nbody)}


@either
@pytest.mark.parametrize("hills", [False, True])
def test_mjcf_has_cameras_that_see_the_scene_sensors_and_its_start(
    native: Carsim, body: dict[str, Any], hills: bool
) -> None:
    block = {**BLOCK, "kind": "box", "x_m": 1.5, "y_m": 0.0}
    rough = {**POSE, "y_m": 0.0, "kind": "rough", "length_m": 0.4, "width_m": 0.6}
    rough |= {"height_sd_m": 0.002, "correlation_m": 0.05, "seed": 1}
    scene = empty_scene([block, rough] if hills else [block], x_m=-0.2, goal_x_m=2.0)
    scene["start"]["heading_rad"] = 0.4
    text = mjcf(native, body, scene, "Foldcar1")
    model = mujoco.MjModel.from_xml_string(text)
    assert ElementTree.fromstring(text).get("model") == "Foldcar1"
    assert (model.nhfield == 1) == hills
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    mujoco.mj_forward(model, data)

    assert data.qpos == pytest.approx(model.qpos0) and data.ncon == 0
    # MuJoCo takes the floor's 100 m for the scene otherwise, and shows a car of one pixel.
    assert model.stat.extent == pytest.approx(1.6, abs=0.1)
    place = data.cam_xpos[model.camera("overview").id]
    # A camera looks along its negative z axis.
    ahead = model.stat.center - place
    assert -data.cam_xmat[model.camera("overview").id].reshape(3, 3)[:, 2] @ ahead / numpy.linalg.norm(ahead) > 0.99

    for wheel in body["wheels"]:
        data.ctrl[model.actuator(f"wheel{wheel['channel']}_servo").id] = 0.5
    before = data.time
    mujoco.mj_step(model, data, round(1.5 / model.opt.timestep))
    assert data.time - before == pytest.approx(1.5)
    speed = data.sensor("wheel0_speed").data[0]
    assert speed == pytest.approx(0.5 * 11.519 * body["supply_v"] / 6.0, rel=0.2) or hills
    data.ctrl[:] = 0
    mujoco.mj_step(model, data, round(1.5 / model.opt.timestep))
    # At rest an accelerometer shows gravity upwards.
    assert numpy.linalg.norm(data.sensor("imu_acceleration").data) == pytest.approx(9.81, abs=0.3)
    assert data.sensor("imu_turn_rate").data == pytest.approx([0, 0, 0], abs=0.05)


@either
def test_urdf_leaves_no_mass_speed_or_friction_to_a_programs_defaults(body: dict[str, Any]) -> None:
    """PyBullet and DART give 1 kg to a link without inertia, PyBullet a friction of 0.5 to one without; DART holds a
    joint at its limit of speed."""
    robot = ElementTree.fromstring(urdf(body, "car"))

    links = {link.get("name"): link for link in robot.iter("link")}
    masses = [float(link.find("inertial/mass").get("value")) for link in links.values()]
    assert min(masses) > 0
    assert sum(masses) == pytest.approx(mass_and_center(body)[0])
    children = {joint.find("child").get("link") for joint in robot.findall("joint")}
    assert set(links) - children == {"base_link"}
    grips = {f"wheel{wheel['channel']}": wheel["grip"] for wheel in body["wheels"]}
    grips |= {f"segment{i}" if i else "base_link": part["grip"] for i, part in enumerate(body["segments"])}
    for name, link in links.items():
        assert name is not None
        assert float(link.find("contact/lateral_friction").get("value")) == pytest.approx(grips[name])
        assert float(robot.find(f"gazebo[@reference='{name}']/mu1").text) == pytest.approx(grips[name])
    speeds = [float(limit.get("velocity", "nan")) for limit in robot.iter("limit")]
    assert len(speeds) == len(links) - 1 and min(speeds) > 10
    wheels = {f"{wheel}_axle" for wheel in grips if wheel.startswith("wheel")}
    assert {joint.get("name") for joint in robot.findall("transmission/joint")} == wheels


@either
def test_a_webots_proto_follows_the_grammar_and_weighs_what_the_body_does(body: dict[str, Any]) -> None:
    file = Reader(webots_proto(body, "FoldcarTest", "a car")).read()

    (robot,) = file.nodes
    assert (file.name, robot.name) == ("FoldcarTest", "Robot")
    mass, center = mass_and_center(body)
    weights = list(physics_places(robot, numpy.zeros(3)))
    assert sum(weight for weight, _ in weights) == pytest.approx(mass)
    assert sum(w * place for w, place in weights) / mass == pytest.approx(center, abs=1e-9)
    motors = robot.all("RotationalMotor")
    stall = body["wheels"][0]["servo"]["stall_torque_n_m"] * body["supply_v"]
    assert len({motor.fields["name"] for motor in motors}) == len(motors) == 4
    assert motors[0].fields["maxTorque"] == pytest.approx(stall / body["wheels"][0]["servo"]["rated_v"])
    for physics in robot.all("Physics"):
        assert physics.fields["density"] == -1
        assert len(physics.fields["inertiaMatrix"]) == 2


def physics_places(node: ReadNode, frame: Any) -> Any:
    """Mass and centre of mass (m, robot's frame) of every solid; none of them is rotated."""
    if node.name == "Solid":
        assert "rotation" not in node.fields
        frame = frame + numpy.array(node.fields.get("translation", [0, 0, 0]))
    if "physics" in node.fields:
        physics = node.fields["physics"].fields
        yield physics["mass"], frame + numpy.array(physics["centerOfMass"][0])
    inner = [*node.fields.get("children", []), node.fields.get("endPoint")]
    for inner_node in inner:
        if isinstance(inner_node, ReadNode):
            yield from physics_places(inner_node, frame)


def test_a_webots_world_holds_the_car_and_the_scene() -> None:
    body = car_body()
    terrain = [{"kind": kind, **BLOCK} for kind in ("box", "ramp", "half_round")]
    rough = {"kind": "rough", **BLOCK}
    scene = empty_scene(terrain, friction=0.5)
    grid = smooth_ground({**scene, "terrain": [rough]}, lambda _, x, y: 0.01 * numpy.sin(20 * x) * numpy.cos(9 * y))
    file = Reader(webots_world(body, "FoldcarTest", scene, grid)).read()

    assert file.protos == ["../protos/FoldcarTest.proto"]
    assert [node.name for node in file.nodes[:2]] == ["WorldInfo", "Viewpoint"]
    assert file.nodes[-1].name == "FoldcarTest"
    height_m = start_height_m(body, scene, grid)
    assert file.nodes[-1].fields["translation"] == pytest.approx([0, 0, height_m], abs=1e-8)
    frictions = {c.fields["material2"]: c.fields["coulombFriction"] for c in file.nodes[0].all("ContactProperties")}
    assert frictions["wheel0 tyre"] == [0.5 * body["wheels"][0]["grip"]]
    assert frictions["segment0 belly"] == [pytest.approx(0.5 * body["segments"][0]["grip"])]
    solids = {n.fields["name"]: n for n in file.nodes if n.name == "Solid"}
    surface = solids["uneven ground"].fields["boundingObject"].fields
    assert len(surface["height"]) == surface["xDimension"] * surface["yDimension"]
    assert surface["height"] == pytest.approx(grid.z_m.ravel(), abs=1e-6)
    assert solids["box 0"].fields["translation"] == [1.0, 0.1, 0.0]
    assert solids["box 0"].fields["boundingObject"].all("Box")[0].fields["size"] == pytest.approx([0.4, 0.6, 0.15])
    arc = solids["half_round 2"].fields["boundingObject"]
    radius = arc.all("Cylinder")[0].fields["radius"]
    assert arc.fields["translation"][2] + radius == pytest.approx(0.05)
    assert radius**2 == pytest.approx(0.2**2 + (radius - 0.05) ** 2)


def test_a_webots_ramp_is_closed_and_its_faces_look_outwards() -> None:
    scene = empty_scene([{"kind": "ramp", **BLOCK}])
    file = Reader(webots_world(car_body(), "FoldcarTest", scene, None)).read()
    wedge = next(n for n in file.nodes if n.fields.get("name") == "ramp 0").all("IndexedFaceSet")[0]
    points = numpy.array(wedge.fields["coord"].fields["point"])
    faces = [list(map(int, face.split())) for face in " ".join(map(str, wedge.fields["coordIndex"])).split("-1")[:-1]]

    edges = [(a, b) for f in faces for a, b in zip(f, [*f[1:], f[0]], strict=True)]
    assert len(set(edges)) == len(edges) == len({(b, a) for a, b in edges} & set(edges))
    middle = points.mean(axis=0)
    for f in faces:
        normal = numpy.cross(points[f[1]] - points[f[0]], points[f[2]] - points[f[1]])
        assert normal @ (points[f].mean(axis=0) - middle) > 0
    # A prism: rising from 0 to 50 mm over 0.4 m, and 100 mm deep, 0.6 m wide.
    volume = sum(
        points[f[0]] @ numpy.cross(points[f[i]], points[f[i + 1]]) / 6 for f in faces for i in range(1, len(f) - 1)
    )
    assert volume == pytest.approx(0.4 * 0.6 * (0.1 + 0.025))


@pytest.mark.parametrize("to", ["mjcf", "urdf", "webots"])
def test_the_command_writes_each_format(
    to: str, foldcar: Callable[..., "subprocess.CompletedProcess[str]"], write_listing: Any, listing_data: Any
) -> None:
    listing_data["environments"]["1"]["wbt_filename"] = "worlds/pyramids.wbt"
    file = write_listing(listing_data)
    more = [] if to == "urdf" else ["--environment", "1", "--sample", "2"]
    done = foldcar("model", file, "--vehicle", "1", "--set", "width=95", "--to", to, "-o", "models", *more)

    assert done.returncode == 0, done.stderr
    names = {"mjcf": ["Foldcar1_width95_env1_sample2.xml"], "urdf": ["Foldcar1_width95.urdf"]}
    webots = ["protos/Foldcar1_width95.proto", "worlds/pyramids_Foldcar1_width95_env1_sample2.wbt"]
    webots += [f"controllers/foldcar_pulses/{name}" for name in ("foldcar_pulses.py", f"{names['mjcf'][0][:-4]}.json")]
    expected = names.get(to, webots)
    assert done.stdout.split() == [f"models/{name}" for name in expected]
    texts = [(file.parent / "models" / Path(name)).read_text() for name in expected]
    if to == "webots":
        world = Reader(texts[1]).read()
        assert Reader(texts[0]).read().name == world.nodes[-1].name == "Foldcar1_width95"
        assert world.nodes[-1].fields["controllerArgs"] == ["Foldcar1_width95_env1_sample2"]
        assert json.loads(texts[3])["motors"] == [f"wheel{i} servo" for i in range(4)]
    else:
        model = mujoco.MjModel.from_xml_string(texts[0])
        assert model.body("wheel3").mass > 0
        assert to == "urdf" or model.geom("box5").type == mujoco.mjtGeom.mjGEOM_BOX
        assert f'"{Path(expected[0]).stem}"' in texts[0].splitlines()[to == "urdf"]


def test_without_mujoco_a_line_says_what_builds_it(native: Carsim, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CarsimError, match="mjcf: this program's engine is not MuJoCo"):
        mjcf(Carsim(), car_body())
    with pytest.raises(CarsimError, match=r"body\.track_m: -1.0 is below the limit"):
        mjcf(native, {**car_body(), "track_m": -1})
    monkeypatch.setattr(engines, "source_tree", lambda: Path("/nowhere"))
    with pytest.raises(CarsimError, match=r"no carsim with MuJoCo built at .*: run `make mujoco`"):
        Carsim(engine=MUJOCO)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "stl"], "--to stl: not one of mjcf, urdf, webots"),
        (["--to", "mjcf", "--environment", "7"], 'has no environment "7"; known: 1'),
    ],
)
def test_the_command_refuses_in_one_line(
    words: list[str],
    message: str,
    foldcar: Callable[..., "subprocess.CompletedProcess[str]"],
    write_listing: Any,
    listing_data: Any,
) -> None:
    listing_data["vehicles"]["1"]["params"] = []
    done = foldcar("model", write_listing(listing_data), "--vehicle", "1", "-o", "models", *words)

    assert done.returncode == 2
    assert message in done.stderr and done.stderr.count("\n") == 1
