"""Two speed bumps across the car's path, with height and distance as parameters."""

model model

param bump_height = 0.02
param bump_length = 0.06    # along the way
param bump_x = 0.35         # middle of the first bump
param bump_gap = 0.34       # gap between the bumps
param goal_distance = 0.35  # from the middle of the second bump to the goal

near_bump = new Bump at (globalParameters.bump_x, 0), facing -90 deg,
    with length globalParameters.bump_length,
    with height globalParameters.bump_height

far_bump = new Bump ahead of near_bump by globalParameters.bump_gap,
    with length globalParameters.bump_length,
    with height globalParameters.bump_height

goal = new Goal at (far_bump.position.x + globalParameters.goal_distance, 0), facing -90 deg

ego = new Robot at (0, 0), facing goal
