"""A yard to cross: a kerb, rough ground, then a second kerb that stands askew. Edit it: docs/scenarios.md has the vocabulary.

Lengths are in metres. What is random is drawn anew for each sample; every design meets the same samples.
"""

model model

param kerb_height = 0.03    # the listing may change it: "scenic_params": {"kerb_height": 0.02}

ego = new Robot at (0, 0), facing Normal(-90 deg, 0.03)

first = new Kerb at (Range(0.35, 0.5), 0), facing -90 deg,
    with height globalParameters.kerb_height
rough = new RoughGround ahead of first by Range(0.05, 0.1), with length 0.3, with amplitude 0.004
second = new Kerb ahead of rough by Range(0.05, 0.1),
    facing Range(-110, -70) deg,
    with height Range(0.7, 1.3) * globalParameters.kerb_height

# A run has passed when the car crosses this line before its time is over.
goal = new Goal at (second.position.x + 0.4, 0), facing -90 deg
