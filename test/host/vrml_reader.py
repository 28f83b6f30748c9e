"""Reads Webots worlds and PROTOs by their grammar, and checks every node and field against Webots' definitions.

NODES is what the nodes of R2023b have, from the definitions that Webots ships (resources/nodes/*.wrl and the
reference manual): of each field its type.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

POSE = "translation=SFVec3f rotation=SFRotation children=MFNode"
SOLID = f"{POSE} name=SFString contactMaterial=SFString boundingObject=SFNode physics=SFNode"
DEFINITIONS = f"""\
Pose: {POSE}
Solid: {SOLID}
Robot: {SOLID} controller=SFString controllerArgs=MFString
WorldInfo: basicTimeStep=SFFloat contactProperties=MFNode
Viewpoint: orientation=SFRotation position=SFVec3f
Background: skyColor=MFColor
DirectionalLight: direction=SFVec3f intensity=SFFloat castShadows=SFBool
ContactProperties: material1=SFString material2=SFString coulombFriction=MFFloat bounce=SFFloat
Physics: density=SFFloat mass=SFFloat centerOfMass=MFVec3f inertiaMatrix=MFVec3f damping=SFNode
HingeJoint: jointParameters=SFNode device=MFNode endPoint=SFNode
HingeJointParameters: axis=SFVec3f anchor=SFVec3f minStop=SFFloat maxStop=SFFloat springConstant=SFFloat \
dampingConstant=SFFloat
RotationalMotor: name=SFString maxVelocity=SFFloat maxTorque=SFFloat sound=SFString
PositionSensor: name=SFString
Shape: appearance=SFNode geometry=SFNode
PBRAppearance: baseColor=SFColor roughness=SFFloat metalness=SFFloat
Box: size=SFVec3f
Cylinder: height=SFFloat radius=SFFloat
Plane: size=SFVec2f
ElevationGrid: height=MFFloat xDimension=SFInt32 xSpacing=SFFloat yDimension=SFInt32 ySpacing=SFFloat thickness=SFFloat
IndexedFaceSet: coord=SFNode coordIndex=MFInt32
Coordinate: point=MFVec3f
"""
NODES = {
    name: dict(pair.split("=") for pair in fields.split())
    for name, fields in (line.split(":") for line in DEFINITIONS.splitlines())
}
# The fields of a car's PROTO.
CAR = NODES["Pose"] | {"name": "SFString", "controller": "SFString", "controllerArgs": "MFString"}
NUMBERS_A_VALUE = {"Float": 1, "Int32": 1, "Vec2f": 2, "Vec3f": 3, "Color": 3, "Rotation": 4}
TOKEN = re.compile(r'#[^\n]*|"(?:\\.|[^"\\])*"|[\[\]{}]|[^\s\[\]{},"#]+|,|\s+')


@dataclass
class ReadNode:
    """A node with its fields: lists of numbers, strings, booleans, nodes."""

    name: str
    fields: dict[str, Any] = field(default_factory=dict)

    def all(self, name: str) -> "list[ReadNode]":
        """All nodes of that name in it."""
        result = [self] if self.name == name else []
        for value in self.fields.values():
            for item in value if isinstance(value, list) else [value]:
                if isinstance(item, ReadNode):
                    result += item.all(name)
        return result


@dataclass
class ReadFile:
    """``protos`` are the names of EXTERNPROTOs; ``interface`` the fields of a PROTO; ``name`` its name."""

    nodes: list[ReadNode]
    protos: list[str]
    name: str = ""
    interface: dict[str, str] = field(default_factory=dict)


class Reader:
    """Reads one file; AssertionError where it is against the grammar."""

    def __init__(self, text: str) -> None:
        assert text.startswith("#VRML_SIM R2023b utf8\n")
        assert "".join(TOKEN.findall(text)) == text
        self.tokens = [t for t in TOKEN.findall(text) if not t.isspace() and not t.startswith("#") and t != ","]
        self.file = ReadFile([], [])

    def read(self) -> ReadFile:
        while self.tokens and self.tokens[0] == "EXTERNPROTO":
            self.take("EXTERNPROTO")
            self.file.protos.append(self.take()[1:-1])
        if self.tokens and self.tokens[0] == "PROTO":
            self.take("PROTO")
            self.file.name = self.take()
            for _ in self.until("[", "]"):
                self.take("field")
                kind, name = self.take(), self.take()
                self.file.interface[name] = kind
                self.value(kind)
            self.file.nodes += [self.node() for _ in self.until("{", "}")]
            assert len(self.file.nodes) == 1 and not self.tokens
        while self.tokens:
            self.file.nodes.append(self.node())
        return self.file

    def take(self, expected: str | None = None) -> str:
        token = self.tokens.pop(0)
        assert expected is None or token == expected, f"{token} where {expected} belongs"
        return token

    def until(self, first: str, last: str) -> Iterator[None]:
        """Once for each thing between two brackets."""
        self.take(first)
        while self.tokens[0] != last:
            yield
        self.take(last)

    def node(self) -> ReadNode:
        node = ReadNode(self.take())
        extern = {name.rsplit("/", 1)[-1].removesuffix(".proto") for name in self.file.protos}
        known = CAR if node.name in extern else NODES.get(node.name)
        assert known is not None, f"no node {node.name}"
        for _ in self.until("{", "}"):
            name = self.take()
            assert name in known, f"{node.name} has no field {name}"
            assert name not in node.fields, f"{node.name}.{name} stands twice"
            node.fields[name] = self.value(known[name])
        return node

    def value(self, kind: str) -> Any:
        if self.tokens[0] == "IS":
            self.take("IS")
            name = self.take()
            assert self.file.interface[name] == kind
            return name
        if kind.startswith("MF"):
            listed = self.tokens[0] == "["
            return [self.single(kind[2:]) for _ in (self.until("[", "]") if listed else [None])]
        return self.single(kind[2:])

    def single(self, kind: str) -> Any:
        if kind == "Node":
            if self.tokens[0] != "NULL":
                return self.node()
            self.take("NULL")
            return None
        if kind == "String":
            text = self.take()
            assert text[0] == text[-1] == '"'
            return text[1:-1]
        if kind == "Bool":
            return {"TRUE": True, "FALSE": False}[self.take()]
        numbers = [(int if kind == "Int32" else float)(self.take()) for _ in range(NUMBERS_A_VALUE[kind])]
        return numbers[0] if len(numbers) == 1 else numbers
