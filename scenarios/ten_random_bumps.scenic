"""Ten bumps of random size and position between start and goal, without contact of each other.

The published field of bumps. Its target is a point; here it is the line through that point, because a car without
steering leaves the field at any place along it.
"""

model model

param course_x_min = -1.2
param course_x_max = 1.2
param course_y_min = -1.2
param course_y_max = 1.4
param bumps = 10
param lowest = 0.01         # range of heights
param highest = 0.03

start = new Marker at (0, 1)
end = new Marker at (0, -1)

bump_region = RectangularRegion((0, 0), 0, 2, 0.5)

for _ in range(globalParameters.bumps):
    new Bump in bump_region, facing 0 deg,
        with width Range(0.05, 0.1),
        with length Range(0.05, 0.1),
        with height Range(globalParameters.lowest, globalParameters.highest),
        with allowCollisions False

ego = new Robot at start, facing toward end
goal = new Goal at end, facing 180 deg
