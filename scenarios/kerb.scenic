"""A kerb of random height, slope and friction across the car's path, and the goal right behind its edge: a short run."""

model model

param kerb_x = 0.19          # edge of the kerb
param lowest = 0.005
param highest = 0.045
param friction = Range(0.5, 0.9)
param goal_distance = 0.15   # of the goal line behind the edge

height = Range(globalParameters.lowest, globalParameters.highest)
kerb = new Kerb at (globalParameters.kerb_x + 0.25, 0), facing Normal(-90 deg, 0.05),
    with length 0.5,
    with height height,
    with face Range(0.002, 0.02)

goal = new Goal at (globalParameters.kerb_x + globalParameters.goal_distance, 0), facing -90 deg

ego = new Robot at (0, 0), facing goal
