"""The vocabulary of foldcar's environments: terrain, the car's start, its goal.

A program begins with `model model`, places terrain, names one Robot `ego` and places one Goal. Lengths are
metres, angles radians (or `90 deg`). Scenic's heading 0 points along +y: `facing -90 deg` travels along +x.
Everything stands on the ground: positions need x and y only, and an object's height counts upwards from z = 0.
docs/scenarios.md shows how to use it.
"""

import sys

# Coulomb friction coefficient of a tyre on the ground, where no FrictionPatch says otherwise.
param friction = 0.6

# The course: leaving this rectangle ends a run.
param course_x_min = -0.5
param course_x_max = 2.0
param course_y_min = -1.0
param course_y_max = 1.0

# Interval (s) at which a program's conditions, monitors and records are evaluated during a simulation.
param outer_step_s = 0.25


def creation_line():
    """The file and line of the program that creates an object, for error messages."""
    frame = sys._getframe()
    own_file = frame.f_code.co_filename
    while frame is not None:
        file = frame.f_code.co_filename
        if file.endswith(".scenic") and file != own_file:
            return (file, frame.f_lineno)
        frame = frame.f_back
    return (own_file, 0)


class Thing(Object):
    """Base of the vocabulary. Things may overlap, be anywhere and hide each other, because checking that they do not
    takes ten times as long as sampling. A program that needs the check uses `with allowCollisions False`."""
    allowCollisions: True
    regionContainedIn: everywhere
    requireVisible: False
    occluding: False
    creationLine: creation_line()


class Terrain(Thing):
    """Something to drive over. Its `length` lies along its heading, its `width` across."""

    def pieces(self):
        """Its terrain pieces (docs/carsim.md), in the object's frame.

        A piece that is not at the object's centre has `x_m` (ahead), `y_m` (to the left) or `heading_rad`
        (counter-clockwise).
        """
        raise NotImplementedError(f"{type(self).__name__} does not define `pieces`")


class SpeedBump(Terrain):
    """Base of speed bumps: `Bump` has a rectangular section, `RoundBump` a circular arc. They do not overlap each
    other, unless `with allowCollisions True`."""
    allowCollisions: False
    length: 0.06
    width: 1.2
    height: 0.02


class Bump(SpeedBump):
    """A rectangular speed bump: one block."""

    def pieces(self):
        return [block(self.length, self.width, self.height)]


class RoundBump(SpeedBump):
    """A half-round speed bump: a circular arc over its length, at most half as high as long."""

    def pieces(self):
        return [{"kind": "half_round", "length_m": self.length, "width_m": self.width, "height_m": self.height}]


class Step(Bump):
    """A platform as long as a car, with a step up and a step down. Steps may be stacked."""
    allowCollisions: True
    length: 0.4


class Kerb(Terrain):
    """The edge of a pavement: a face that slopes over the length `face`, and the level pavement behind it."""
    length: 0.3
    width: 1.2
    height: 0.02
    face: 0.01

    def pieces(self):
        return slope_and_block(self.face, self.length - self.face, self.width, self.height, -self.length / 2)


class Ramp(Terrain):
    """A ramp along its heading: up over `run_up`, level over `plateau`, down over `run_down`; each may be 0."""
    run_up: 0.2
    plateau: 0.0
    run_down: 0.0
    length[final]: self.run_up + self.plateau + self.run_down
    width: 0.6
    height: 0.04

    def pieces(self):
        parts = slope_and_block(self.run_up, self.plateau, self.width, self.height, -self.length / 2)
        if self.run_down:
            # A slope rises along its heading, so the descending one is turned by 180 degrees.
            back = slope(self.run_down, self.width, self.height, self.length / 2 - self.run_down)
            parts.append({**back, "heading_rad": 180 deg})
        return parts


class StepPyramid(Terrain):
    """A square pyramid of `steps` steps of equal height: `top_side` is the side of the highest square, `tread` the
    depth of the other steps."""
    steps: 3
    step_height: 0.0215
    top_side: 0.07
    tread: 0.04
    length[final]: self.top_side + 2 * self.tread * (self.steps - 1)
    width[final]: self.top_side + 2 * self.tread * (self.steps - 1)
    height[final]: self.step_height * self.steps

    def pieces(self):
        sides = [self.top_side + 2 * self.tread * level for level in range(self.steps)]
        return [block(side, side, self.step_height * (self.steps - level)) for level, side in enumerate(sides)][::-1]


class GaussianHill(Terrain):
    """A Gaussian hill, `height` high; a negative height is a hollow. Its `length` and `width` are two standard deviations
    each way. Instead, `sd_along` and `sd_across` its heading may be given; `sd_across` is `sd_along` by default."""
    sd_along: None
    sd_across: self.sd_along
    height: 0.03
    length: sides_of(self.sd_along, 0.32)
    width: sides_of(self.sd_across, self.length)

    def pieces(self):
        for sd, side in (("sd_along", "length"), ("sd_across", "width")):
            given, size = getattr(self, sd), getattr(self, side)
            if given is not None and abs(4 * given - size) > 1e-9:
                raise ValueError(f"{side} {size:g} m is not 4 times {sd}, {given:g} m: give one of the two")
        return [{"kind": "hill", "sd_along_m": self.length / 4, "sd_across_m": self.width / 4, "height_m": self.height}]


class Flat(Terrain):
    """Base of terrain whose `height` has no meaning."""
    height[final]: 0.001


class Pothole(Flat):
    """A round hole of this `diameter`, `depth` deep at the centre; its wall slopes over the width `edge`."""
    diameter: 0.16
    depth: 0.015
    edge: 0.03
    length[final]: self.diameter
    width[final]: self.diameter

    def pieces(self):
        return [{"kind": "pothole", "radius_m": self.diameter / 2, "depth_m": self.depth, "edge_m": self.edge}]


class RoughGround(Flat):
    """Random heights with standard deviation `amplitude` and correlation length `correlation`. They depend on
    `seed`, which every sample draws unless the program sets it."""
    length: 0.6
    width: 1.0
    amplitude: 0.003
    correlation: 0.03
    seed: DiscreteRange(0, 2**31 - 1)

    def pieces(self):
        return [{"kind": "rough", "length_m": self.length, "width_m": self.width, "height_sd_m": self.amplitude,
                 "correlation_m": self.correlation, "seed": self.seed}]


class FrictionPatch(Flat):
    """Ground with its own friction coefficient; of overlapping patches the one created last applies."""
    length: 0.3
    width: 1.0
    friction: 0.3

    def pieces(self):
        return [{"kind": "patch", "length_m": self.length, "width_m": self.width, "friction": self.friction}]


class Marker(Thing):
    """A pose without an object, on the course. Noise of `mutate` moves it alone; that of a Point moves what is placed
    relative to it too."""
    width: 0.01
    length: 0.01
    height: 0.01


class Goal(Marker):
    """The car's goal: the line through this position across its heading, to be crossed along the heading; with
    `reach`, the disc of that radius around this position."""
    reach: None


class Robot(Thing):
    """The car under test, always `ego`. The design determines its real size; the size here is for specifiers such as
    `behind`, and is the area that must be free of edges at the start."""
    length: 0.2
    width: 0.1
    height: 0.12
    consumedEnergy[dynamic]: 0.0  # joules since the start


def sides_of(sd, otherwise):
    """Two standard deviations each way, where one is given."""
    return otherwise if sd is None else 4 * sd


def block(length, width, height, x=0.0):
    """A block whose centre is `x` ahead."""
    return {"kind": "box", "x_m": x, "length_m": length, "width_m": width, "height_m": height}


def slope(length, width, height, rear):
    """A slope that rises over `length` from its edge at x = `rear`."""
    return {"kind": "ramp", "x_m": rear + length / 2, "length_m": length, "width_m": width, "height_m": height}


def slope_and_block(run, level, width, height, rear):
    """A slope that rises from x = `rear`, and level ground behind it; parts of length 0 are left out."""
    parts = [slope(run, width, height, rear)] if run else []
    return parts + ([block(level, width, height, rear + run + level / 2)] if level else [])
