"""Figure 12 of the publication: ten bumps of random size and place between start and end, which do not intersect.

It differs from the print where a comment says so; docs/publication.md tells why.
"""

# The print leaves out the world model, which defines Bump and Robot, and the course.
model model
param course_x_min = -1.2
param course_x_max = 1.2
param course_y_min = -1.2
param course_y_max = 1.4

# Declare several useful locations
startPos = new Point at (0,1)  # Print: without new
endPos = new Point at (0,-1)  # Print: without new

# Create 10 randomly sized bumps in a central region of the map
bump_region = RectangularRegion((0,0), 0, 2, 0.5)

for _ in range(10):
    new Bump in bump_region,  # Print: without new
      with width Range(0.05,0.1),
      with length Range(0.05,0.1),
      with height Range(0.01,0.03)

# Create a robot, representing the ego
ego = new Robot at startPos, facing toward endPos  # Print: Robot at startPos facing endPos

# The print has no end of a run. This one ends on the line through endPos, because a car without steering leaves the
# bumps at any place along it.
goal = new Goal at endPos, facing 180 deg
