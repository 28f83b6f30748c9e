"""The published program with its own termination and records: two bumps, one under the wheels of each side.

It differs from the printed one where Scenic has changed: objects are created by `new` and face `toward` a point.
Mutation of a point does not move objects placed relative to it, so the printed `mutate bumpCenter, startPos, endPos
by 0.01` is replaced by normal distributions of the positions.
"""

model model

param course_x_min = -1.0
param course_x_max = 1.0
param course_y_min = -1.4
param course_y_max = 1.4
param simulationTimeLimit = 120   # seconds
param bump_height = 0.03
param position_sd = 0.01          # standard deviation of each position

def near(x, y):
    return (Normal(x, globalParameters.position_sd), Normal(y, globalParameters.position_sd))

# Declare several useful locations
bumpCenter = new OrientedPoint at near(0, 0)
startPos = new Marker at near(0, 1)
endPos = new Marker at near(0, -1)
target = endPos

# Create two bumps left and right of the bump center.
new Bump left of bumpCenter by 0.05,
    with width 0.1,
    with length 0.1,
    with height globalParameters.bump_height
new Bump right of bumpCenter by 0.05,
    with width 0.1,
    with length 0.1,
    with height globalParameters.bump_height

# Create a robot, representing the ego
ego = new Robot at startPos, facing toward endPos

# Termination conditions
terminate when (distance from ego to target) <= 0.05
terminate after globalParameters.simulationTimeLimit seconds

# Record simulation data
record final (distance to target) as distanceToTarget
record final ego.consumedEnergy as consumedEnergy
record final simulation().currentRealTime as elapsedTime
# Distinguishes arrival from the end of the time limit.
record final (distance to target) <= 0.05 as passed
