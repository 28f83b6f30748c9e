#include "track_terrain.h"

#include <algorithm>
#include <cmath>

#include "box2d_units.h"
#include "elementary_functions.h"

namespace foldcar {
namespace {

// The terrain is cut anew when heading, place aside or sine of roll differ by more than this from those of the last
// cut.
constexpr double kHeadingTolerance_rad = 0.01;
constexpr double kSidewaysTolerance_m = 0.001;
constexpr double kRollTolerance = 0.02;
// A plan reaches this far before and behind the car.
constexpr double kAhead_m = 0.11;
constexpr double kBehind_m = 0.03;

// Lines along the track whose heights differ by less than this carry the wheel or belly together.
constexpr double kSameHeight_m = 0.0003;

// The point `metres` further along x at the same height: outlines continue level beyond their ends.
b2Vec2 beyond(b2Vec2 end, double metres) { return {end.x + to_units(metres), end.y}; }

}  // namespace

TrackTerrain::TrackTerrain(const Ground& ground, const BodySpec& body, const CarConstants& constants)
    : ground_(ground),
      track_m_(body.track_m),
      tyre_width_m_(constants.tyre_width_m),
      belly_width_m_(constants.belly_width_m),
      belly_drop_m_(constants.belly_clearance_m),
      reach_m_(constants.reach_m) {}

// Whether the car at `pose` needs another cut than the last one.
bool TrackTerrain::stale(const CutPose& pose) const {
  if (!cut_once_) return true;
  const double dx = pose.frame.x_m - at_.frame.x_m, dy = pose.frame.y_m - at_.frame.y_m;
  const auto [s, c] = sine_and_cosine(pose.frame.heading_rad);
  const double sideways_m = c * dy - s * dx;
  return std::abs(pose.frame.heading_rad - at_.frame.heading_rad) > kHeadingTolerance_rad ||
         std::abs(sideways_m) > kSidewaysTolerance_m || std::abs(pose.q - at_.q) > kRollTolerance ||
         outside_plan(pose);
}

bool TrackTerrain::outside_plan(const CutPose& pose) const {
  return pose.s_m - reach_m_ < planned_m_.s_min_m || pose.s_m + reach_m_ > planned_m_.s_max_m;
}

// Returns the strip across the car over which an outline is cut (0: left wheels, 1: right wheels, 2: belly), at the
// sine q of roll. Roll about the contacts moves the belly, belly_drop_m_ above them, sideways.
LateralSpan TrackTerrain::across(int outline, double q) const {
  const double cosine = std::sqrt(1 - q * q), half_m = 0.5 * (outline < 2 ? tyre_width_m_ : belly_width_m_);
  const double middle_m = outline < 2 ? (outline == 0 ? 0.5 : -0.5) * track_m_ * cosine : -belly_drop_m_ * q;
  return {-half_m, half_m, middle_m, cosine, q};
}

// Plans the stations, at which outlines are sampled, anew if the car has left the planned range, heading or track.
void TrackTerrain::plan(const CutPose& pose) {
  const double dx = pose.frame.x_m - planned_at_.frame.x_m, dy = pose.frame.y_m - planned_at_.frame.y_m;
  const auto [s, c] = sine_and_cosine(planned_at_.frame.heading_rad);
  const bool left = std::abs(c * dy - s * dx) > kPlanSideways_m ||
                    std::abs(pose.frame.heading_rad - planned_at_.frame.heading_rad) > kPlanTurn_rad ||
                    outside_plan(pose);
  if (!left) return;
  const Span span{-reach_m_ - kBehind_m, reach_m_ + kAhead_m};
  for (int k = 0; k < 3; ++k) grounds_[k].plan(ground_, pose.frame, pose.s_m, span, across(k, pose.q));
  planned_at_ = pose;
  planned_m_ = {pose.s_m + span.s_min_m, pose.s_m + span.s_max_m};
}

void TrackTerrain::cut(const CutPose& pose) {
  plan(pose);
  at_ = pose;
  cut_once_ = true;
  for (int k = 0; k < 3; ++k) {
    grounds_[k].cut(pose.frame, pose.s_m, across(k, pose.q), kSameHeight_m, profiles_[k]);
    make_edges(k);
  }
}

// Converts an outline's profile to Box2D edges, which run from right to left and skip vertices too close to each
// other. Each edge is given its neighbours' vertices, so that Box2D makes no contact with the joint of two edges.
void TrackTerrain::make_edges(int outline) {
  const Profile& profile = profiles_[outline];
  std::vector<OutlineEdge>& edges = edges_[outline];
  edges.clear();
  const double per_height = 1 / std::sqrt(1 - at_.q * at_.q);
  constexpr float kClosest = 0.25f * 9 * b2_linearSlop * b2_linearSlop;  // (half the profile's resolution)²
  b2Vec2 before = to_units(profile.back().s1_m, profile.back().z1_m * per_height);
  for (auto segment = profile.rbegin(); segment != profile.rend(); ++segment) {
    const b2Vec2 vertex = to_units(segment->s0_m, segment->z0_m * per_height);
    if (b2DistanceSquared(before, vertex) <= kClosest) continue;
    OutlineEdge edge{{}, segment->y_min_m, segment->y_max_m};
    edge.shape.m_vertex1 = before;
    edge.shape.m_vertex2 = vertex;
    before = vertex;
    edges.push_back(edge);
  }
  for (std::size_t i = 0; i < edges.size(); ++i) {
    b2EdgeShape& shape = edges[i].shape;
    shape.m_oneSided = true;
    shape.m_vertex0 = i > 0 ? edges[i - 1].shape.m_vertex1 : beyond(shape.m_vertex1, 1);
    shape.m_vertex3 = i + 1 < edges.size() ? edges[i + 1].shape.m_vertex2 : beyond(shape.m_vertex2, -1);
  }
}

// Returns the ground's rise to the left (m/m) below the wheels of outline k, at s_m before the cut's frame.
double TrackTerrain::side_slope(int k, double s_m) const {
  const GroundOutline::Ends edges = grounds_[k].ends(at_.s_m + s_m);
  // The lines' heights are lowered by their share of the tilt; they stand closer together in a car that leans.
  const LateralSpan span = across(k, at_.q);
  return ((edges.to_z_m - edges.from_z_m) / tyre_width_m_ + span.tilt) / span.scale;
}

}  // namespace foldcar
