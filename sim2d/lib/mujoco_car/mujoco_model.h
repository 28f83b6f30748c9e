// A car on a scene's ground as a MuJoCo model.
//
// Choices that MuJoCo leaves to the model:
// - Contacts have sliding friction only (condim 3: the line of contact of a cylindrical tyre resists yaw by itself),
//   elliptic cones, because friction is isotropic, and a priority above the ground's, so that the car's part determines
//   the coefficient. impratio 10 prevents tyres from creeping on slopes.
// - The time constant of contacts is 5 ms, two and a half steps, unless a tyre has its own: penetrations stay under 0.1 mm
//   but in impacts. What MuJoCo's friction adds to the normal force of a contact that slips is taken away in mujoco_car.cpp.
// - multiccd is off, because it gives cylinders wrong normals at the edges of boxes. The Jacobian is dense, because a
//   car has few degrees of freedom, and constraint islands are not sought, because it is one.
// - The servo is MuJoCo's general actuator: torque τ·u − (τ/ω0)·ω, limited to ±τ; the rotor is the joint's armature.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <vector>

#include "body_spec.h"
#include "scene_spec.h"
#include "terrain.h"

namespace foldcar {

// cylinder: as wide as the tyre; ellipsoid: a contact point in the tyre's middle plane.
enum class TyreShape { kCylinder, kEllipsoid };

struct MujocoOptions {
  double step_s = 0.002;
  TyreShape tyre = TyreShape::kCylinder;
};

struct DeleteSpec {
  void operator()(mjSpec* spec) const { mj_deleteSpec(spec); }
};

struct DeleteModel {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
};

// The model with the indices of what a car asks it for. Joint j of the tree is the free one, then hinges and wheels.
struct MujocoModel {
  std::unique_ptr<mjModel, DeleteModel> model;
  std::vector<int> segment;         // body ids, front to back
  std::vector<int> belly, tyre;     // geom ids, of segments and wheels
  std::vector<int> hinge_position;  // indices into qpos
  std::vector<int> wheel_velocity;  // indices into qvel
  std::vector<int> actuator;        // ids by wheel, -1 without a servo
};

// The model to compile: the car's origin is in the world's.
std::unique_ptr<mjSpec, DeleteSpec> mujoco_spec(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                                const MujocoOptions& options);

// The same compiled. Throws std::runtime_error if MuJoCo refuses the model.
MujocoModel build_mujoco_model(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                               const MujocoOptions& options);

}  // namespace foldcar
