"""The published program with its own ending and records: two bumps, one under the wheels of each side.

It differs from the printed one where Scenic has changed since: objects are made by `new` and face `toward` a
place. Mutating a place would not move what was placed relative to it, so the printed `mutate bumpCenter, startPos,
endPos by 0.01` stands in the places themselves.
"""

model model

param course_x_min = -1.0
param course_x_max = 1.0
param course_y_min = -1.4
param course_y_max = 1.4
param simulationTimeLimit = 120   # seconds
param bump_height = 0.03
param position_sd = 0.01          # of each place

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
# Only this tells a run that arrived from one that ran out of time.
record final (distance to target) <= 0.05 as passed
