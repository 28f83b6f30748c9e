// The engine's model as a file of MuJoCo's: MJCF.
//
// The car stands at the scene's start, where the engine puts it down. Besides there is what people see and read, none
// of which changes the physics: a lamp, the cameras "overview" of the scene and "follow" of the car, accelerometer and
// gyro of the car, speed and torque of each wheel, and the keyframe "start".
#pragma once

#include <string>

#include "body_spec.h"
#include "mujoco_model.h"
#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

// The file's text; name is the model's. Throws std::runtime_error if MuJoCo refuses the model.
std::string mujoco_xml(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                       const MujocoOptions& options, const std::string& name);

}  // namespace foldcar
