// A scene's ground as static geoms of a MuJoCo model.
//
// Boxes, ramps and half-rounds become boxes, convex wedges and horizontal cylinders, which extend below the floor, so
// that none of their faces coincides with it. Smooth ground becomes one height field with boxes for the level floor
// around it, because a plane would fill its hollows.
#pragma once

#include <mujoco/mujoco.h>

#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

// Adds the ground to the world of spec.
void add_mujoco_ground(mjSpec* spec, const SceneSpec& scene, const Terrain& terrain);

}  // namespace foldcar
