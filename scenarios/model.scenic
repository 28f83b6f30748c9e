"""The vocabulary of foldcar's environments: what stands on flat ground, where a car starts, where it is to go.

A program begins with `model model`, places terrain, names one Robot `ego` and places one Goal. Lengths are
metres, angles radians (or `90 deg`). Scenic's heading 0 points along +y: `facing -90 deg` travels along +x.
Everything stands on the ground: positions need x and y only, and an object's height counts upwards from z = 0.
docs/scenarios.md explains each name with an example.
"""

# Coulomb friction coefficient of a tyre on everything in the environment.
param friction = 0.6

# The course: leaving this rectangle ends a run.
param course_x_min = -0.5
param course_x_max = 2.0
param course_y_min = -1.0
param course_y_max = 1.0


class Thing(Object):
    """Base of the vocabulary. Things may overlap, stand anywhere and hide each other: checking that they do not
    costs ten times the sampling itself. A program that wants it says `with allowCollisions False`."""
    allowCollisions: True
    regionContainedIn: everywhere
    requireVisible: False
    occluding: False


class Terrain(Thing):
    """Something to drive over, made of upright boxes that share its position and heading."""

    def boxes(self):
        """The boxes as (length along the heading, width across it, height), in metres."""
        raise NotImplementedError(f"{type(self).__name__} does not say which boxes it is made of")


class Bump(Terrain):
    """A speed bump: one box, its `length` along its heading, its `width` across."""
    length: 0.06
    width: 1.2
    height: 0.02

    def boxes(self):
        return [(self.length, self.width, self.height)]


class Step(Bump):
    """A platform as long as a car: climbed first and left later."""
    length: 0.4


class StepPyramid(Terrain):
    """A square pyramid of `steps` equal steps: `top_side` is the side of the highest square, `tread` the depth of
    every other step."""
    steps: 3
    step_height: 0.0215
    top_side: 0.07
    tread: 0.04
    length: self.top_side + 2 * self.tread * (self.steps - 1)
    width: self.top_side + 2 * self.tread * (self.steps - 1)
    height: self.step_height * self.steps

    def boxes(self):
        sides = [self.top_side + 2 * self.tread * level for level in range(self.steps)]
        return [(side, side, self.step_height * (self.steps - level)) for level, side in enumerate(sides)][::-1]


class Marker(Thing):
    """A place with a heading that nothing stands on. It can be mutated, which a Point cannot."""
    width: 0.01
    length: 0.01
    height: 0.01


class Goal(Marker):
    """Where the car is to go: the line through this place across its heading, to be crossed along the heading;
    with a `reach`, the disc of that radius around this place."""
    reach: None


class Robot(Thing):
    """The car under test, always `ego`. Its size is the design's and not the environment's: the size here only
    serves specifiers such as `behind`."""
    length: 0.2
    width: 0.1
    height: 0.12
