#include "mujoco_xml.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include "elementary_functions.h"
#include "mujoco_car.h"

namespace foldcar {
namespace {

using Vector = std::array<double, 3>;

// Radius of the ground that the overview shows beyond start, goal and terrain.
constexpr double kReach_m = 0.5;
// Directions from the middle of the overview to the camera (from behind, right and above) and to the lamp, in radii of
// the overview.
constexpr Vector kEye = {-1.4, -1.9, 1.5};
constexpr Vector kLamp = {-0.6, -0.9, 3.0};

// Circle around start, goal and terrain, as far as they lie within the course.
struct Shown {
  double x_m, y_m, radius_m;
};

Shown shown(const SceneSpec& scene) {
  std::vector<double> x_m, y_m;
  const auto add = [&](const auto& place) {
    x_m.push_back(std::clamp(place.x_m, scene.course.x_min_m, scene.course.x_max_m));
    y_m.push_back(std::clamp(place.y_m, scene.course.y_min_m, scene.course.y_max_m));
  };
  const auto add_all = [&](const auto&... lists) { (std::for_each(lists.begin(), lists.end(), add), ...); };
  add(scene.start);
  if (scene.goal) add(*scene.goal);
  const TerrainSpec& terrain = scene.terrain;
  add_all(terrain.blocks, terrain.hills, terrain.potholes, terrain.roughs, terrain.patches);
  const auto [left, right] = std::minmax_element(x_m.begin(), x_m.end());
  const auto [low, high] = std::minmax_element(y_m.begin(), y_m.end());
  return {0.5 * (*left + *right), 0.5 * (*low + *high), 0.5 * hypotenuse(*right - *left, *high - *low) + kReach_m};
}

// Adds a camera that looks at the point (x_m, y_m, 0) of a body, from distance_m · kEye away.
void add_camera(mjsBody* body, const char* name, double x_m, double y_m, double distance_m, mjtCamLight mode) {
  mjsCamera& camera = *mjs_addCamera(body, nullptr);
  mjs_setName(camera.element, name);
  camera.mode = mode;
  const double target[] = {x_m, y_m, 0}, across = hypotenuse(kEye[0], kEye[1]);
  for (std::size_t i = 0; i < 3; ++i) camera.pos[i] = target[i] + distance_m * kEye[i];
  // Right and up in the picture; kEye is a unit vector.
  camera.alt.type = mjORIENTATION_XYAXES;
  const double axes[] = {-kEye[1] / across,           kEye[0] / across,            0,
                         -kEye[0] * kEye[2] / across, -kEye[1] * kEye[2] / across, across};
  std::copy(std::begin(axes), std::end(axes), camera.alt.xyaxes);
}

// Adds light and the camera "overview", which shows the whole scene.
void add_lamp_and_overview(mjSpec* spec, const SceneSpec& scene) {
  const Shown what = shown(scene);
  mjsBody* world = mjs_findBody(spec, "world");
  const double middle[] = {what.x_m, what.y_m, 0};
  std::copy(std::begin(middle), std::end(middle), spec->stat.center);
  spec->stat.extent = what.radius_m;
  mjsLight& lamp = *mjs_addLight(world, nullptr);
  for (std::size_t i = 0; i < 3; ++i) {
    lamp.pos[i] = middle[i] + what.radius_m * kLamp[i];
    lamp.dir[i] = -kLamp[i];
    lamp.diffuse[i] = 0.5F;
    lamp.specular[i] = 0;
    // The headlight is low, so that shapes have a light and a dark side.
    spec->visual.headlight.ambient[i] = 0.35F;
    spec->visual.headlight.diffuse[i] = 0.2F;
    spec->visual.headlight.specular[i] = 0;
  }
  lamp.cutoff = 60;
  spec->visual.global.offwidth = 1280;
  spec->visual.global.offheight = 960;
  add_camera(world, "overview", what.x_m, what.y_m, 0.8 * what.radius_m, mjCAMLIGHT_FIXED);
}

void add_sensor(mjSpec* spec, const std::string& name, mjtSensor type, mjtObj kind, const std::string& of) {
  mjsSensor& sensor = *mjs_addSensor(spec);
  mjs_setName(sensor.element, name.c_str());
  sensor.type = type;
  sensor.objtype = kind;
  mjs_setString(sensor.objname, of.c_str());
}

void add_sensors(mjSpec* spec, const BodySpec& body) {
  const std::string part = "segment" + std::to_string(main_segment(body));
  mjs_setName(mjs_addSite(mjs_findBody(spec, part.c_str()), nullptr)->element, "imu");
  add_sensor(spec, "imu_acceleration", mjSENS_ACCELEROMETER, mjOBJ_SITE, "imu");
  add_sensor(spec, "imu_turn_rate", mjSENS_GYRO, mjOBJ_SITE, "imu");
  for (const WheelSpec& wheel : body.wheels) {
    const std::string name = "wheel" + std::to_string(wheel.channel);
    add_sensor(spec, name + "_speed", mjSENS_JOINTVEL, mjOBJ_JOINT, name + "_axle");
    if (wheel.driven()) add_sensor(spec, name + "_torque", mjSENS_ACTUATORFRC, mjOBJ_ACTUATOR, name + "_servo");
  }
}

}  // namespace

// Returns the scene and car as MuJoCo's XML, with cameras, light and sensors, and the car's start as key frame
// "start".
std::string mujoco_xml(const BodySpec& body, const SceneSpec& scene, const Terrain& terrain,
                       const MujocoOptions& options, const std::string& name) {
  if (body.supply_resistance_ohm > 0) {
    throw std::runtime_error("body " + body.id + ": supply_resistance_ohm: a file of MuJoCo has no supply that sags");
  }
  MujocoCar car(body, scene, terrain, options, nullptr);
  const double* start = car.data().qpos;
  const auto spec = mujoco_spec(body, scene, terrain, options);
  mjs_setString(spec->modelname, name.c_str());
  mjsBody& front = *mjs_findBody(spec.get(), "segment0");
  std::copy(start, start + 3, front.pos);
  std::copy(start + 3, start + 7, front.quat);
  double length_m = 0;
  for (const SegmentSpec& part : body.segments) length_m = std::max(length_m, 2 * part.x_m + part.length_m);
  add_camera(&front, "follow", 0, 0, 1.6 * length_m, mjCAMLIGHT_TRACKCOM);
  add_lamp_and_overview(spec.get(), scene);
  add_sensors(spec.get(), body);
  mjsKey& key = *mjs_addKey(spec.get());
  mjs_setName(key.element, "start");
  mjs_setDouble(key.qpos, start, static_cast<int>(car.model().nq));
  const std::unique_ptr<mjModel, DeleteModel> model(mj_compile(spec.get(), nullptr));
  if (model == nullptr) throw std::runtime_error(std::string("MuJoCo: ") + mjs_getError(spec.get()));
  // With a buffer that is too small, the answer is the size that it takes.
  char error[500] = "";
  std::string text(1, '\0');
  const int size = mj_saveXMLString(spec.get(), text.data(), 1, error, sizeof error);
  if (size > 0) text.resize(static_cast<std::size_t>(size) + 1);
  if (size <= 0 || mj_saveXMLString(spec.get(), text.data(), size + 1, error, sizeof error) != 0) {
    throw std::runtime_error(std::string("MuJoCo: ") + error);
  }
  text.resize(text.find('\0'));
  return text;
}

}  // namespace foldcar
