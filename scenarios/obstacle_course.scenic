"""All obstacles of the vocabulary in sequence, with random positions."""

model model

param course_x_max = 6.0
param height = 0.02         # of the sharp-edged obstacles
param rough_sd = 0.005      # of the rough ground
param ice_friction = 0.25
param position_sd = 0.01    # standard deviation of every obstacle's position
param heading_sd = 0.02     # of the start, radians

def near(x, y=0):
    return (Normal(x, globalParameters.position_sd), Normal(y, globalParameters.position_sd))

# Bumps under both wheels.
new Bump at near(0.4), facing -90 deg, with height globalParameters.height
new RoundBump at near(0.75), facing -80 deg, with height 1.4 * globalParameters.height

# A ramp, a kerb and a step.
new Ramp at near(1.4), facing -90 deg,
    with run_up 0.3, with plateau 0.2, with run_down 0.2, with height 0.05
new Kerb at near(2.1), facing -90 deg, with height globalParameters.height
new Step at near(2.37), facing -90 deg, with length 0.25, with height 2 * globalParameters.height

# Obstacles under single wheels: rough ground with holes, a slippery patch, hills, a pyramid.
new RoughGround at near(3.1), facing -90 deg,
    with length 0.8, with amplitude globalParameters.rough_sd
new Pothole at near(2.95, 0.07)
new Pothole at near(3.25, -0.06), with diameter 0.2

new FrictionPatch at near(3.8), facing -90 deg,
    with length 0.4, with friction globalParameters.ice_friction
new GaussianHill at near(3.85, 0.1), facing -60 deg, with sd_along 0.06, with sd_across 0.1,
    with height 0.05
new GaussianHill at near(4.25, -0.12), with height 0.04
new GaussianHill at near(4.3, 0.12), with height -0.02

new StepPyramid at near(4.8, 0.05), facing -90 deg,
    with step_height globalParameters.height

finish = new Marker at (5.3, 0), facing -90 deg
ego = new Robot at near(0), facing Normal(-90 deg, globalParameters.heading_sd)
goal = new Goal at finish, facing finish.heading
