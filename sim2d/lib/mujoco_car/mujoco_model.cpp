#include "mujoco_model.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "elementary_functions.h"
#include "mujoco_ground.h"
#include "plain_quaternion.h"

namespace foldcar {
namespace {

// Stiffness of friction over that of the normal force: at 1, MuJoCo's default, tyres creep on slopes.
constexpr double kImpedanceRatio = 10;

constexpr float kCarColour[] = {0.1F, 0.45F, 0.7F, 0.6F};
constexpr float kTyreColour[] = {0.2F, 0.2F, 0.2F, 1};

void set_inertia(mjsBody& body, double mass_kg, double x_m, double y_m, double z_m, double xx, double yy, double zz) {
  body.explicitinertial = 1;
  body.mass = mass_kg;
  set_vector(body.ipos, x_m, y_m, z_m);
  set_vector(body.inertia, xx, yy, zz);
}

// Adds a massless geom of the car to a body. Bits and priority: it collides with the ground only, and its own friction
// counts, not the ground's.
mjsGeom& car_geom(mjsBody* of, const std::string& name, double friction, double contact_time_s, const float (&colour)[4]) {
  mjsGeom& geom = *mjs_addGeom(of, nullptr);
  mjs_setName(geom.element, name.c_str());
  geom.contype = 2;
  geom.conaffinity = 1;
  geom.priority = 1;
  geom.condim = 3;
  geom.friction[0] = friction;
  geom.solref[0] = contact_time_s;
  geom.mass = 0;
  std::copy(std::begin(colour), std::end(colour), geom.rgba);
  return geom;
}

// Adds the pitch hinge, with its flexure's spring and limits, to the segment behind it.
void add_hinge(mjsBody* rear, const std::string& name, const HingeSpec& spec) {
  mjsJoint& joint = *mjs_addJoint(rear, nullptr);
  mjs_setName(joint.element, name.c_str());
  joint.type = mjJNT_HINGE;
  set_vector(joint.axis, 0, 1, 0);
  set_vector(joint.pos, spec.x_m, 0, spec.z_m);
  joint.limited = mjLIMITED_TRUE;
  joint.range[0] = spec.min_rad;
  joint.range[1] = spec.max_rad;
  joint.stiffness[0] = spec.stiffness_n_m_rad;
  joint.damping[0] = spec.damping_n_m_s_rad;
}

// Adds a wheel to its segment: a body turned by its camber, its axle, a disc's inertia and the tyre's geom, whose
// centre is off the axle by the eccentricity.
void add_wheel(mjsBody* of, const BodySpec& body, const WheelSpec& spec, double friction, TyreShape shape) {
  const std::string name = "wheel" + std::to_string(spec.channel);
  mjsBody* wheel = mjs_addBody(of, nullptr);
  mjs_setName(wheel->element, name.c_str());
  const double side = spec.side == CarSide::kLeft ? 1 : -1;
  set_vector(wheel->pos, spec.x_m, 0.5 * side * body.track_m, 0);
  // A turn about the car's x leans tops to the right.
  const double lean_rad = -side * spec.camber_rad;
  set_quaternion(wheel->quat, cosine(0.5 * lean_rad), sine(0.5 * lean_rad), 0, 0);
  mjsJoint& axle = *mjs_addJoint(wheel, nullptr);
  mjs_setName(axle.element, (name + "_axle").c_str());
  axle.type = mjJNT_HINGE;
  set_vector(axle.axis, 0, 1, 0);
  axle.armature = spec.servo.rotor_inertia_kg_m2;
  const double x_m = spec.eccentricity_m * cosine(spec.eccentricity_phase_rad);
  const double z_m = spec.eccentricity_m * sine(spec.eccentricity_phase_rad);
  // A uniform disc as wide as the tyre.
  const double spin = 0.5 * spec.mass_kg * spec.radius_m * spec.radius_m;
  const double across = 0.5 * spin + spec.mass_kg * spec.width_m * spec.width_m / 12;
  set_inertia(*wheel, spec.mass_kg, x_m, 0, z_m, across, spin, across);
  mjsGeom& tyre = car_geom(wheel, name + "_tyre", friction * spec.grip, spec.contact_time_s, kTyreColour);
  set_vector(tyre.pos, x_m, 0, z_m);
  if (shape == TyreShape::kCylinder) {
    tyre.type = mjGEOM_CYLINDER;
    set_vector(tyre.size, spec.radius_m, 0.5 * spec.width_m, 0);
    // The cylinder's axis, its z, along the car's y.
    set_quaternion(tyre.quat, -std::sqrt(0.5), std::sqrt(0.5), 0, 0);
  } else {
    tyre.type = mjGEOM_ELLIPSOID;
    set_vector(tyre.size, spec.radius_m, 0.5 * spec.width_m, spec.radius_m);
  }
}

// Adds a wheel's servo: an actuator with torque = stall · (control - rate / no-load speed), limited to ± stall, at the
// supply's voltage.
void add_servo(mjSpec* spec, const BodySpec& body, const WheelSpec& wheel) {
  const double scale = body.supply_v / wheel.servo.rated_v;
  const double stall_n_m = wheel.servo.stall_torque_n_m * scale, no_load = wheel.servo.no_load_speed_rad_s * scale;
  const std::string name = "wheel" + std::to_string(wheel.channel);
  mjsActuator& servo = *mjs_addActuator(spec, nullptr);
  mjs_setName(servo.element, (name + "_servo").c_str());
  servo.trntype = mjTRN_JOINT;
  mjs_setString(servo.target, (name + "_axle").c_str());
  servo.gaintype = mjGAIN_FIXED;
  servo.gainprm[0] = stall_n_m;
  servo.biastype = mjBIAS_AFFINE;
  servo.biasprm[2] = -stall_n_m / no_load;
  servo.ctrllimited = servo.forcelimited = mjLIMITED_TRUE;
  servo.ctrlrange[0] = -1;
  servo.ctrlrange[1] = 1;
  servo.forcerange[0] = -stall_n_m;
  servo.forcerange[1] = stall_n_m;
}

// Adds the car: segments as a chain of bodies, the first one free, each with inertia, belly and wheels; then the
// servos.
void add_car(mjSpec* spec, const BodySpec& body, const SceneSpec& scene, TyreShape shape) {
  mjsBody* parent = mjs_findBody(spec, "world");
  for (std::size_t i = 0; i < body.segments.size(); ++i) {
    const SegmentSpec& segment = body.segments[i];
    mjsBody* part = mjs_addBody(parent, nullptr);
    const std::string name = "segment" + std::to_string(i);
    mjs_setName(part->element, name.c_str());
    if (i == 0) {
      mjs_addFreeJoint(part);
    } else {
      add_hinge(part, "hinge" + std::to_string(i - 1), body.hinges[i - 1]);
    }
    set_inertia(*part, segment.mass_kg, segment.com_x_m, segment.com_y_m, segment.com_z_m, segment.roll_inertia_kg_m2,
                segment.pitch_inertia_kg_m2, segment.yaw_inertia_kg_m2);
    mjsGeom& belly = car_geom(part, name + "_belly", scene.friction * segment.grip, kContactTime_s, kCarColour);
    belly.type = mjGEOM_BOX;
    set_vector(belly.size, 0.5 * segment.length_m, 0.5 * segment.width_m, 0.5 * segment.height_m);
    set_vector(belly.pos, segment.x_m, 0, segment.center_z_m);
    for (const WheelSpec& wheel : body.wheels) {
      if (static_cast<std::size_t>(wheel.segment) == i) add_wheel(part, body, wheel, scene.friction, shape);
    }
    parent = part;
  }
  for (const WheelSpec& wheel : body.wheels) {
    if (wheel.driven()) add_servo(spec, body, wheel);
  }
}

int id(const mjModel& model, mjtObj kind, const std::string& name) { return mj_name2id(&model, kind, name.c_str()); }

}  // namespace

// Describes options, ground and car for MuJoCo.
std::unique_ptr<mjSpec, DeleteSpec> mujoco_spec(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                                                const MujocoOptions& options) {
  std::unique_ptr<mjSpec, DeleteSpec> spec(mj_makeSpec());
  spec->compiler.degree = 0;
  spec->compiler.inertiafromgeom = mjINERTIAFROMGEOM_FALSE;
  spec->compiler.usethread = 0;
  spec->option.timestep = options.step_s;
  set_vector(spec->option.gravity, 0, 0, -kGravity_m_s2);
  spec->option.integrator = mjINT_IMPLICITFAST;
  spec->option.cone = mjCONE_ELLIPTIC;
  spec->option.impratio = kImpedanceRatio;
  spec->option.jacobian = mjJAC_DENSE;
  spec->option.disableflags |= mjDSBL_MULTICCD | mjDSBL_ISLAND;
  add_mujoco_ground(spec.get(), scene, terrain);
  add_car(spec.get(), body, scene, options.tyre);
  return spec;
}

// Compiles the description and looks up the indices of the car's parts. Throws std::runtime_error with MuJoCo's
// message.
MujocoModel build_mujoco_model(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                               const MujocoOptions& options) {
  const auto spec = mujoco_spec(body, scene, terrain, options);
  MujocoModel built;
  built.model.reset(mj_compile(spec.get(), nullptr));
  if (built.model == nullptr) throw std::runtime_error(std::string("MuJoCo: ") + mjs_getError(spec.get()));
  const mjModel& model = *built.model;
  for (std::size_t i = 0; i < body.segments.size(); ++i) {
    const std::string name = "segment" + std::to_string(i);
    built.segment.push_back(id(model, mjOBJ_BODY, name));
    built.belly.push_back(id(model, mjOBJ_GEOM, name + "_belly"));
  }
  for (std::size_t i = 0; i < body.hinges.size(); ++i) {
    built.hinge_position.push_back(model.jnt_qposadr[id(model, mjOBJ_JOINT, "hinge" + std::to_string(i))]);
  }
  for (const WheelSpec& wheel : body.wheels) {
    const std::string name = "wheel" + std::to_string(wheel.channel);
    built.tyre.push_back(id(model, mjOBJ_GEOM, name + "_tyre"));
    built.wheel_velocity.push_back(model.jnt_dofadr[id(model, mjOBJ_JOINT, name + "_axle")]);
    built.actuator.push_back(id(model, mjOBJ_ACTUATOR, name + "_servo"));
  }
  return built;
}

}  // namespace foldcar
