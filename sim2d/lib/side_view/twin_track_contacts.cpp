// Reads the contacts after a step of the plane: wheel loads, roll and yaw couples, friction limits and impulses.
#include <algorithm>
#include <cmath>

#include "twin_track_car.h"

namespace foldcar {
namespace {

// The impulse of an impact passes from a light wheel through its frame to the chassis, which takes the solver many
// iterations. A step counts as an impact if one wheel's normal force on a steep face (horizontal component of the unit
// normal) or the sum of all wheels' exceeds these shares of the weight; the next step then has more iterations.
constexpr double kImpactWheelLoad = 0.2;
constexpr double kImpactNormal = 0.3;
constexpr double kImpactTotalLoad = 1.5;

// Share of the axles' load imbalance that is corrected in a step; correcting all of it disturbs a car that climbs.
constexpr float kBalanceShare = 0.5f;

}  // namespace

std::optional<std::size_t> TwinTrackCar::belly_of(const b2Body* a, const b2Body* b) const {
  for (std::size_t j = 0; j < car_.segments.size(); ++j) {
    if (car_.segments[j].chassis == a || car_.segments[j].chassis == b) return j;
  }
  return std::nullopt;
}

void TwinTrackCar::read_contacts() {
  for (WheelState& wheel : wheels_) {
    wheel.load_n = 0;
    wheel.support = nullptr;
  }
  load_ = CarriedLoad();
  contacts_.clear();
  contact_points_.clear();
  contact_yaw_n_m_ = 0;
  impact_ = false;
  if (terrain_.has_patches()) update_belly_friction();
  for (b2Contact* contact = world_.GetContactList(); contact != nullptr; contact = contact->GetNext()) {
    if (!contact->IsTouching()) continue;
    const b2Body* a = contact->GetFixtureA()->GetBody();
    const b2Body* b = contact->GetFixtureB()->GetBody();
    if (const std::optional<std::size_t> segment = belly_of(a, b)) {
      read_belly(*segment, *contact);
      continue;
    }
    for (std::size_t i = 0; i < wheels_.size(); ++i) {
      if (car_.wheel[i] == a || car_.wheel[i] == b) read_tyre(i, *contact);
    }
  }
  double loads_n = 0, friction = 0;
  for (const WheelState& wheel : wheels_) {
    loads_n += wheel.load_n;
    friction += wheel.friction / static_cast<double>(wheels_.size());
  }
  if (loads_n > kImpactTotalLoad * constants_.mass_kg * kGravity_m_s2) impact_ = true;
  if (terrain_.has_patches()) {
    set_mass(*car_.roll, car_.roll->GetMass(),
             plane_roll_inertia_kg_m2(body_, constants_, friction) - constants_.frames_roll_kg_m2);
  }
}

void TwinTrackCar::read_tyre(std::size_t wheel, b2Contact& contact) {
  const WheelSpec& spec = body_.wheels[wheel];
  const std::size_t side = static_cast<std::size_t>(spec.side);
  const double q = sin_roll_limited(car_.roll->GetAngle());
  const double tyre_y_m = (side == 0 ? 0.5 : -0.5) * body_.track_m * cos_roll(q);
  // The plane yaws by the difference of its tracks' forces, as if the centre of mass were midway between them. Roll
  // moves it to the side, so the sum of the forces has a couple as well.
  const double aside_m = constants_.com_height_m * q;
  for (int j = 0; j < contact.GetManifold()->pointCount; ++j) {
    const ContactPoint point = contact_point(*car_.wheel[wheel], contact, j);
    if (point.normal_n_s <= 0) continue;
    wheels_[wheel].support = wheels_[wheel].load_n > 0 ? nullptr : &contact.GetManifold()->points[j];
    const double normal_n = point.normal_n_s / step_s_;
    wheels_[wheel].load_n += normal_n;
    impact_ = impact_ || (std::abs(point.normal.x) > kImpactNormal &&
                          normal_n > kImpactWheelLoad * constants_.mass_kg * kGravity_m_s2);
    load_.height_n_m += point.up_n * constants_.com_height_m;
    load_.width_n_m += point.up_n * spec.width_m;
    contact_yaw_n_m_ -= point.forward_n * aside_m;
    GroundContact& ground = add_contact(point, car_.track[side], tyre_y_m + aside_m,
                                          wheels_[wheel].friction * spec.grip);
    ground.slip_mass_kg = wheels_[wheel].slip_mass_kg;
    const double slope = ground_.side_slope(static_cast<int>(side), to_metres(point.position.x), point.z_m);
    ground.slope_n_s = -slope * point.normal_n_s * std::abs(point.normal.y);
  }
  if (!terrain_.has_patches()) return;
  b2WorldManifold where;
  contact.GetWorldManifold(&where);
  update_wheel_friction(wheel, to_metres(where.points[0].x));
  contact.ResetFriction();
}

void TwinTrackCar::read_belly(std::size_t segment, b2Contact& contact) {
  const double height_m = constants_.com_height_m - constants_.belly_clearance_m;
  const double aside_m = height_m * tan_roll(car_.roll->GetAngle());
  for (int j = 0; j < contact.GetManifold()->pointCount; ++j) {
    const ContactPoint point = contact_point(*car_.segments[segment].chassis, contact, j);
    if (point.normal_n_s <= 0) continue;
    const double y_m = ground_.belly_contact_y_m(to_metres(point.position.x));
    load_.height_n_m += point.up_n * height_m;
    load_.middle_n_m += point.up_n * y_m;
    contact_yaw_n_m_ -= point.forward_n * (y_m + aside_m);
    const double friction = friction_at(to_metres(point.position.x), y_m) * body_.segments[segment].grip;
    if (terrain_.has_patches()) contact.SetFriction(static_cast<float>(friction));
    add_contact(point, nullptr, y_m + aside_m, friction);
  }
}

TwinTrackCar::ContactPoint TwinTrackCar::contact_point(b2Body& body, b2Contact& contact, int index) const {
  b2WorldManifold where;
  contact.GetWorldManifold(&where);
  const b2ManifoldPoint& impulses = contact.GetManifold()->points[index];
  const double to_newton = 1 / (step_s_ * kUnitsPerMetre);
  ContactPoint point;
  point.body = &body;
  point.position = where.points[index];
  point.normal = contact.GetFixtureB()->GetBody() == &body ? where.normal : -where.normal;
  point.tangent = b2Cross(point.normal, 1.0f);
  point.z_m = to_metres(point.position.y);
  point.normal_n_s = to_metres(impulses.normalImpulse);
  point.tangent_n_s = to_metres(impulses.tangentImpulse);
  const b2Vec2 impulse = impulses.normalImpulse * point.normal + impulses.tangentImpulse * point.tangent;
  point.forward_n = impulse.x * to_newton;
  point.up_n = impulse.y * to_newton;
  return point;
}

GroundContact& TwinTrackCar::add_contact(const ContactPoint& point, const b2Body* track, double left_m,
                                         double friction) {
  const b2Vec2 from_com = point.position - car_.chassis->GetPosition();
  const double pitch_rad = car_.chassis->GetAngle();
  b2Vec2 slip = -point.body->GetLinearVelocityFromWorldPoint(point.position);
  if (track != nullptr) slip += track->GetLinearVelocity();
  GroundContact contact;
  contact.ahead_m = to_metres(from_com.x) + main_.com_x_m - constants_.com_x_m;
  contact.left_m = left_m;
  contact.depth_m = to_metres(std::sin(pitch_rad) * from_com.x - std::cos(pitch_rad) * from_com.y);
  contact.limit_n_s = friction * point.normal_n_s;
  contact.tangent_n_s = point.tangent_n_s;
  contact.tangent_forward = point.tangent.x;
  contact.slip_m_s = to_metres(b2Dot(slip, point.tangent));
  contacts_.push_back(contact);
  contact_points_.push_back(point);
  return contacts_.back();
}

// How the axles of a rigid car on rigid ground share a left-right load difference is statically indeterminate. The
// solver, which treats the contacts in sequence, lets differences of opposite sign build up on the axles; tyres of
// equal stiffness would share it equally. Therefore the impulses from which the solver starts its next step (warm
// starting) are shifted between left and right towards equal shares. The solution still satisfies every contact.
void TwinTrackCar::balance_axle_loads() {
  float mean = 0;
  for (const auto& [left, right] : axles_) {
    const b2ManifoldPoint *a = wheels_[left].support, *b = wheels_[right].support;
    if (a == nullptr || b == nullptr) return;
    mean += 0.5f * (a->normalImpulse - b->normalImpulse) / static_cast<float>(axles_.size());
  }
  for (const auto& [left, right] : axles_) {
    float &a = wheels_[left].support->normalImpulse, &b = wheels_[right].support->normalImpulse;
    const float shift = std::clamp(kBalanceShare * (mean - 0.5f * (a - b)), -a, b);
    a += shift;
    b -= shift;
  }
}

double TwinTrackCar::friction_at(double s_m, double y_m) const {
  if (!terrain_.has_patches()) return friction_;
  const double ahead_m = s_m - to_metres(car_.chassis->GetPosition().x);
  const double c = std::cos(heading_rad_), s = std::sin(heading_rad_);
  return terrain_.friction(com_x_m_ + c * ahead_m - s * y_m, com_y_m_ + s * ahead_m + c * y_m, friction_);
}

// Sets the friction of the wheel's fixture, from which Box2D takes that of new contacts.
void TwinTrackCar::update_wheel_friction(std::size_t wheel, double s_m) {
  const WheelSpec& spec = body_.wheels[wheel];
  const double side = spec.side == CarSide::kLeft ? 0.5 : -0.5;
  wheels_[wheel].friction = friction_at(s_m, side * body_.track_m * cos_roll(car_.roll->GetAngle()));
  car_.wheel[wheel]->GetFixtureList()->SetFriction(fixture_friction(wheels_[wheel].friction * spec.grip));
}

void TwinTrackCar::update_belly_friction() {
  for (std::size_t j = 0; j < car_.segments.size(); ++j) {
    b2Body& chassis = *car_.segments[j].chassis;
    const double friction = friction_at(to_metres(chassis.GetPosition().x), 0);
    chassis.GetFixtureList()->SetFriction(fixture_friction(friction * body_.segments[j].grip));
  }
}

}  // namespace foldcar
