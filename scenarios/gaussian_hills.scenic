"""A field of Gaussian hills of random position, size and direction; overlapping hills add up."""

model model

param hills = 20
param field_x = 0.85        # middle of the field
param field_length = 1.0    # along the way
param field_width = 1.2
param lowest = 0.01         # range of heights
param highest = 0.04
param narrowest = 0.05      # range of the standard deviations along and across
param widest = 0.12

field = RectangularRegion(
    (globalParameters.field_x, 0), 0, globalParameters.field_length, globalParameters.field_width
)

def spread():
    return Range(globalParameters.narrowest, globalParameters.widest)

for _ in range(globalParameters.hills):
    new GaussianHill in field, with yaw Range(0, 180) deg,
        with height Range(globalParameters.lowest, globalParameters.highest),
        with sd_along spread(),
        with sd_across spread()

ego = new Robot at (0, 0), facing -90 deg
goal = new Goal at (globalParameters.field_x + globalParameters.field_length / 2 + 0.3, 0), facing -90 deg
