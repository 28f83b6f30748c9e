"""Two low kerbs that stand askew, for cars with little ground clearance: docs/design_space.md.

Lengths are in metres. The kerbs' heights, angles and distance are random.
"""

model model

param kerb_height = 0.012

ego = new Robot at (0, 0), facing Normal(-90 deg, 0.03)

first = new Kerb at (Range(0.4, 0.5), 0), facing Range(-110, -70) deg,
    with height Range(0.7, 1.3) * globalParameters.kerb_height
second = new Kerb ahead of first by Range(0.1, 0.4), facing Range(-110, -70) deg,
    with height Range(0.7, 1.3) * globalParameters.kerb_height

goal = new Goal at (second.position.x + 0.5, 0), facing -90 deg
