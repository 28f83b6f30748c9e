"""Two step pyramids, the first under the left wheels, the second under the right ones, with random positions.

The publication does not give their sizes. These are chosen with `make pyramids` so that the width study in MuJoCo shows what
it says of its Figure 6; others do too (docs/scenarios.md).
"""

model model

param near_x = 0.45         # centre of the first pyramid
param far_x = 0.90          # centre of the second pyramid
param offset = 0.105        # distance of both from the middle: the first to the left, the second to the right
param step_height = 0.0295
param top_side = 0.09       # side of the highest square
param tread = 0.035
param friction = 0.75
param goal_distance = 0.30  # of the goal line behind the last edge
param position_sd = 0.01    # standard deviation of each centre and of the start
param heading_sd = 0.02     # standard deviation of the heading at the start, radians

class Pyramid(StepPyramid):
    steps: 3
    step_height: globalParameters.step_height
    top_side: globalParameters.top_side
    tread: globalParameters.tread

def noisy(value):
    return Normal(value, globalParameters.position_sd)

near = new Pyramid at (noisy(globalParameters.near_x), noisy(globalParameters.offset)), facing -90 deg
far = new Pyramid at (noisy(globalParameters.far_x), noisy(-globalParameters.offset)), facing -90 deg

ego = new Robot at (noisy(0), noisy(0)), facing Normal(-90 deg, globalParameters.heading_sd)

last_edge = max(near.position.x + near.length / 2, far.position.x + far.length / 2)
goal = new Goal at (last_edge + globalParameters.goal_distance, 0), facing -90 deg
