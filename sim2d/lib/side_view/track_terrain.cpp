#include "track_terrain.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "plane.h"
#include "scene_terrain.h"

namespace foldcar {
namespace {

// The terrain is cut anew when the car has moved further than this: about a millimetre at the wheels.
constexpr double kHeadingTolerance_rad = 0.01;
constexpr double kSidewaysTolerance_m = 0.001;
constexpr double kRollTolerance = 0.02;
constexpr double kAheadTolerance_m = 0.1;
constexpr double kBehindTolerance_m = 0.02;
// The cut reaches this much further than the car may drive before the next cut.
constexpr double kSpare_m = 0.01;

// Lines whose heights differ by less than this carry it together.
constexpr double kSameHeight_m = 0.0003;

// A wheel whose contact is no higher than this above the smooth ground stands on it.
constexpr double kOnGround_m = 0.002;

// Lines across the belly, which is met along narrow strips: obstacles narrower than their distance can be missed. A
// tyre is cut into as many strips as it has lines.
constexpr int kLines[3] = {3, 3, 9};
constexpr int kFirstStrip[3] = {0, 3, 6};
constexpr int kStrips = 15;
constexpr double kLineWidth_m = 0.001;

// Lateral coordinate of a line on the tyre or belly: the outermost lie on its edges.
double line_y_m(int outline, int line, double width_m) { return (line / (kLines[outline] - 1.0) - 0.5) * width_m; }

// What the ends of an outline continue as.
b2Vec2 beyond(b2Vec2 end, double metres) { return {end.x + to_units(metres), end.y}; }

}  // namespace

TrackTerrain::TrackTerrain(const Terrain& terrain, const BodySpec& body, const CarConstants& constants)
    : terrain_(terrain),
      track_m_(body.track_m),
      tyre_width_m_(constants.tyre_width_m),
      belly_width_m_(constants.belly_width_m),
      belly_drop_m_(constants.belly_clearance_m),
      reach_m_(constants.reach_m),
      strips_(kStrips),
      pieces_(kStrips) {}

bool TrackTerrain::stale(const CutPose& pose) const {
  if (!cut_once_) return true;
  const double dx = pose.frame.x_m - at_.frame.x_m, dy = pose.frame.y_m - at_.frame.y_m;
  const double c = std::cos(pose.frame.heading_rad), s = std::sin(pose.frame.heading_rad);
  const double ahead_m = c * dx + s * dy, sideways_m = c * dy - s * dx;
  return std::abs(pose.frame.heading_rad - at_.frame.heading_rad) > kHeadingTolerance_rad ||
         std::abs(sideways_m) > kSidewaysTolerance_m ||
         (terrain_.ground() == nullptr ? ahead_m > kAheadTolerance_m || ahead_m < -kBehindTolerance_m
                                       : outside_plan(pose)) || std::abs(pose.q - at_.q) > kRollTolerance;
}

bool TrackTerrain::outside_plan(const CutPose& pose) const {
  return pose.s_m - reach_m_ < planned_m_.s_min_m || pose.s_m + reach_m_ > planned_m_.s_max_m;
}

void TrackTerrain::set_strips(double q) {
  for (int outline = 0; outline < 3; ++outline) {
    const LateralSpan span = across(outline, q);
    const double width_m = span.to_m - span.from_m;
    const double strip_m = outline < 2 ? span.scale * width_m / kLines[outline] : kLineWidth_m;
    // Strips lie within the width, the outermost at its edges.
    const double between_m = (span.scale * width_m - strip_m) / (kLines[outline] - 1);
    for (int line = 0; line < kLines[outline]; ++line) {
      const double from_m = span.middle_m - 0.5 * span.scale * width_m + between_m * line;
      const int strip = kFirstStrip[outline] + line;
      strips_[static_cast<std::size_t>(strip)] = {from_m, from_m + strip_m};
    }
  }
}

// Roll about the contacts moves the belly, belly_drop_m_ above them, sideways.
LateralSpan TrackTerrain::across(int outline, double q) const {
  const double cosine = std::sqrt(1 - q * q), half_m = 0.5 * (outline < 2 ? tyre_width_m_ : belly_width_m_);
  const double middle_m = outline < 2 ? (outline == 0 ? 0.5 : -0.5) * track_m_ * cosine : -belly_drop_m_ * q;
  return {-half_m, half_m, middle_m, cosine, q};
}

// The smooth ground's outlines at pose; their stations are planned anew if the car has left the planned range.
void TrackTerrain::cut_ground(const CutPose& pose, const Span& span) {
  const double dx = pose.frame.x_m - planned_at_.frame.x_m, dy = pose.frame.y_m - planned_at_.frame.y_m;
  const double c = std::cos(planned_at_.frame.heading_rad), s = std::sin(planned_at_.frame.heading_rad);
  const bool left = std::abs(c * dy - s * dx) > kPlanSideways_m ||
                    std::abs(pose.frame.heading_rad - planned_at_.frame.heading_rad) > kPlanTurn_rad ||
                    outside_plan(pose);
  if (left) {
    for (int k = 0; k < 3; ++k) {
      grounds_[k].plan(*terrain_.ground(), pose.frame, pose.s_m, span, across(k, pose.q));
    }
    planned_at_ = pose;
    planned_m_ = {pose.s_m + span.s_min_m, pose.s_m + span.s_max_m};
  }
  for (int k = 0; k < 3; ++k) {
    grounds_[k].cut(pose.frame, pose.s_m, across(k, pose.q), kSameHeight_m, profiles_[k]);
  }
}

void TrackTerrain::cut(const CutPose& pose) {
  set_strips(pose.q);
  for (auto& list : pieces_) list.clear();
  Span span{-reach_m_ - kBehindTolerance_m - kSpare_m, reach_m_ + kAheadTolerance_m + kSpare_m};
  const bool level = terrain_.ground() == nullptr;
  if (!level) {
    cut_ground(pose, span);
    span = grounds_[0].span(pose.s_m);
  }
  terrain_.slice(pose.frame, span, strips_, pieces_);
  std::size_t count = 0;
  for (const auto& list : pieces_) count += list.size();
  if (static_cast<double>(count) > kMostPieces) {
    throw std::runtime_error("scene.terrain.pieces: the blocks under the car have " + std::to_string(count) +
                             " pieces along its wheels and belly, the limit is " +
                             std::to_string(static_cast<long>(kMostPieces)) + ": let fewer blocks overlap");
  }
  at_ = pose;
  cut_once_ = true;
  for (int outline = 0; outline < 3; ++outline) {
    cut_outline(outline, span, level);
    make_edges(outline);
  }
}

void TrackTerrain::cut_outline(int outline, const Span& span, bool level) {
  const double width_m = outline < 2 ? tyre_width_m_ : belly_width_m_;
  lowered_.clear();
  for (int line = 0; line < kLines[outline]; ++line) {
    const double across_m = line_y_m(outline, line, width_m), lowered_m = across_m * at_.q;
    const int strip = kFirstStrip[outline] + line;
    for (Piece piece : pieces_[static_cast<std::size_t>(strip)]) {
      piece.z0_m -= lowered_m;
      piece.z1_m -= lowered_m;
      piece.y_m = across_m;
      lowered_.push_back(piece);
    }
  }
  if (!level) return raise_to_envelope(lowered_, kProfileResolution_m, scratch_, profiles_[outline]);
  // Level ground carries the lower edge, or both.
  const double low_side_m = std::copysign(0.5 * width_m, -at_.q), ground_z_m = -low_side_m * at_.q;
  if (ground_z_m < 0.5 * kSameHeight_m) {
    lowered_.push_back({span.s_min_m, span.s_max_m, -ground_z_m, -ground_z_m, -low_side_m});
  }
  upper_envelope(lowered_, {span.s_min_m, span.s_max_m, ground_z_m, ground_z_m, low_side_m}, span, kProfileResolution_m,
                 scratch_, profiles_[outline]);
}

// The lines that carry a riser are those of its upper end.
void TrackTerrain::make_edges(int outline) {
  const Profile& profile = profiles_[outline];
  std::vector<OutlineEdge>& edges = edges_[outline];
  edges.clear();
  const double per_height = 1 / std::sqrt(1 - at_.q * at_.q);
  constexpr float kClosest = 0.25f * 9 * b2_linearSlop * b2_linearSlop;  // (half the profile's resolution)²
  b2Vec2 before = to_units(profile.back().s1_m, profile.back().z1_m * per_height);
  const ProfileSegment* right = &profile.back();
  const auto add = [&](double s_m, double z_m, const ProfileSegment& carrier) {
    const b2Vec2 vertex = to_units(s_m, z_m * per_height);
    if (b2DistanceSquared(before, vertex) <= kClosest) return;
    edges.push_back({{}, carrier.y_min_m, carrier.y_max_m});
    edges.back().shape.m_vertex1 = before;
    edges.back().shape.m_vertex2 = vertex;
    before = vertex;
  };
  for (auto segment = profile.rbegin(); segment != profile.rend(); ++segment) {
    add(segment->s1_m, segment->z1_m, segment->z1_m > right->z0_m ? *segment : *right);
    add(segment->s0_m, segment->z0_m, *segment);
    right = &*segment;
  }
  for (std::size_t i = 0; i < edges.size(); ++i) {
    b2EdgeShape& shape = edges[i].shape;
    shape.m_oneSided = true;
    shape.m_vertex0 = i > 0 ? edges[i - 1].shape.m_vertex1 : beyond(shape.m_vertex1, 1);
    shape.m_vertex3 = i + 1 < edges.size() ? edges[i + 1].shape.m_vertex2 : beyond(shape.m_vertex2, -1);
  }
}

double TrackTerrain::side_slope(int k, double s_m, double z_m) const {
  if (terrain_.ground() == nullptr) return 0;
  const GroundOutline::Ends edges = grounds_[k].ends(at_.s_m + s_m);
  if (z_m > std::max(edges.from_z_m, edges.to_z_m) + kOnGround_m) return 0;
  // The lines' heights are lowered by their share of the tilt; they stand closer together in a car that leans.
  const LateralSpan span = across(k, at_.q);
  return ((edges.to_z_m - edges.from_z_m) / tyre_width_m_ + span.tilt) / span.scale;
}

}  // namespace foldcar
