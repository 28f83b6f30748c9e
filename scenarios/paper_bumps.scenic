"""Figure 10 of the publication: two bumps, one under the wheels of each side, with its own ending and records.

It differs from the print where a comment says so, and as Scenic 3 demands: `new` creates an object, a comma separates
specifiers, and a robot faces `toward` a point.
"""

# The print leaves out the world model, which defines Bump and Robot, and the course: its ends lie on the default's edge.
model model
param course_x_min = -1.0
param course_x_max = 1.0
param course_y_min = -1.4
param course_y_max = 1.4
# The print does not define its time limit (s).
param simulationTimeLimit = 120
simulationTimeLimit = globalParameters.simulationTimeLimit

# Declare several useful locations
bumpCenter = new Point at (0,0)
startPos = new Point at (0,1)
endPos = new Point at (0,-1)
# The print does not define its target.
target = endPos

# Create two bumps left and right of the bump center.
new Bump left of bumpCenter by 0.05,
  with width 0.1,
  with length 0.1,
  with height 0.03
new Bump right of bumpCenter by 0.05,
  with width 0.1,
  with length 0.1,
  with height 0.03

# Create a robot, representing the ego
ego = new Robot at startPos, facing toward endPos

# Termination conditions
terminate when distance from ego to target <= 0.05
terminate after simulationTimeLimit seconds

# Record simulation data
record final (distance to target) as distanceToTarget
record final ego.consumedEnergy as consumedEnergy
record final simulation().currentRealTime as elapsedTime
