"""Figure 11 of the publication: the program of figure 10, paper_bumps.scenic, and the line that mutates its points.

The lines of figure 10 are repeated, because Scenic drops the `terminate` and `record` of an imported program.
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
bumpCenter = new Point at (0,0)  # Print: without new
startPos = new Point at (0,1)  # Print: without new
endPos = new Point at (0,-1)  # Print: without new
# The print does not define its target.
target = endPos

# Create two bumps left and right of the bump center.
new Bump left of bumpCenter by 0.05,  # Print: without new
  with width 0.1,
  with length 0.1,
  with height 0.03
new Bump right of bumpCenter by 0.05,  # Print: without new
  with width 0.1,
  with length 0.1,
  with height 0.03

# Create a robot, representing the ego
ego = new Robot at startPos, facing toward endPos  # Print: Robot at startPos facing endPos

# Termination conditions
terminate when distance from ego to target <= 0.05
terminate after simulationTimeLimit seconds

# Record simulation data
record final (distance to target) as distanceToTarget
record final ego.consumedEnergy as consumedEnergy
# Print: its last word on a line of its own
record final simulation().currentRealTime as elapsedTime

# Mutate the points to slightly change their position
# The start and the heading of the robot, both bumps and the target follow their points. The standard deviation is
# 0.01 x 1 m in x and y; the text of the publication says 0.1.
mutate bumpCenter, startPos, endPos by 0.01
