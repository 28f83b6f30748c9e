#include "track_terrain.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "scene_terrain.h"
#include "side_view_terms.h"

namespace foldcar {
namespace {

// The terrain is cut anew when the car has moved further than this: about a millimetre at the wheels.
constexpr double kHeadingTolerance_rad = 0.01;
constexpr double kSidewaysTolerance_m = 0.001;
constexpr double kRollTolerance = 0.02;
constexpr double kAheadTolerance_m = 0.1;
constexpr double kBehindTolerance_m = 0.02;
// A chain whose vertices are within this of the new outline is kept.
constexpr double kChainTolerance_m = 0.0001;
// The cut reaches this much further than the car may drive before the next cut, so that its chain can be kept after it.
constexpr double kSpare_m = 0.04;
// A chain's vertices are moved by no more than this; beyond it the chain is made anew.
constexpr double kAdjust_m = 0.01;

// Lines under the belly whose heights differ by less than this carry it together.
constexpr double kSameHeight_m = 0.0003;

// A wheel whose contact is no higher than this above the smooth ground stands on it.
constexpr double kOnGround_m = 0.002;

// The belly meets the terrain along this many lines; obstacles narrower than their distance can be missed.
constexpr int kBellyLines = 9;
constexpr double kLineWidth_m = 0.001;

// Distance of a line of a belly of that width to the left of the car's middle (m).
double belly_line_y_m(int line, double width_m) {
  return (-1 + 2.0 * line / (kBellyLines - 1)) * 0.5 * (width_m - kLineWidth_m);
}

float height_on_line(b2Vec2 a, b2Vec2 b, float x) {
  return a.x == b.x ? a.y : a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x);
}

// The ghost vertex beyond an end of a chain, with which Box2D keeps wheels from catching on the end.
b2Vec2 ghost_vertex(b2Vec2 end, double metres) { return {end.x + to_units(metres), end.y}; }

}  // namespace

TrackTerrain::TrackTerrain(const Terrain& terrain, const BodySpec& body, const CarConstants& constants)
    : terrain_(terrain),
      track_m_(body.track_m),
      tyre_width_m_(constants.tyre_width_m),
      belly_width_m_(constants.belly_width_m),
      belly_drop_m_(constants.belly_clearance_m),
      reach_m_(constants.reach_m),
      strips_(2 + kBellyLines),
      pieces_(2 + kBellyLines) {}

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
  const double cosine = cos_roll(q);
  for (int k = 0; k < 2; ++k) {
    const double middle_m = (k == 0 ? 0.5 : -0.5) * track_m_ * cosine;
    strips_[k] = {middle_m - 0.5 * tyre_width_m_, middle_m + 0.5 * tyre_width_m_};
  }
  // Roll about the contacts moves the belly, belly_drop_m_ above them, sideways.
  const double shift_m = -belly_drop_m_ * q;
  for (int line = 0; line < kBellyLines; ++line) {
    const double middle_m = shift_m + belly_line_y_m(line, belly_width_m_) * cosine;
    strips_[2 + line] = {middle_m - 0.5 * kLineWidth_m, middle_m + 0.5 * kLineWidth_m};
  }
}

LateralSpan TrackTerrain::across(int outline, double q) const {
  const double cosine = cos_roll(q), tangent = tan_roll(q);
  if (outline < 2) {
    const double half_m = 0.5 * tyre_width_m_;
    return {-half_m, half_m, (outline == 0 ? 0.5 : -0.5) * track_m_ * cosine, 1, 0};
  }
  return {-0.5 * belly_width_m_, 0.5 * belly_width_m_, -belly_drop_m_ * q, cosine, cosine * tangent};
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
  // A point of the belly at y is higher by y·tan(roll), which is the same as terrain lowered by as much.
  const double tangent = tan_roll(pose.q), cosine = cos_roll(pose.q);
  belly_pieces_.clear();
  for (int line = 0; line < kBellyLines; ++line) {
    const double across_m = belly_line_y_m(line, belly_width_m_);
    const double lowered_m = across_m * cosine * tangent;
    for (Piece piece : pieces_[2 + line]) {
      piece.z0_m -= lowered_m;
      piece.z1_m -= lowered_m;
      piece.y_m = across_m;
      belly_pieces_.push_back(piece);
    }
  }
  // Level ground, so lowered, is highest under the lower side of the belly.
  const double low_side_m = std::copysign(0.5 * belly_width_m_, -tangent);
  const double ground_z_m = -low_side_m * cosine * tangent;
  const Piece under_wheels{span.s_min_m, span.s_max_m, 0, 0, 0};
  const bool lies_flat = std::abs(ground_z_m) < kSameHeight_m;
  const Piece under_belly{span.s_min_m, span.s_max_m, ground_z_m, ground_z_m, lies_flat ? 0 : low_side_m};
  for (int k = 0; k < 3; ++k) {
    const std::vector<Piece>& pieces = k < 2 ? pieces_[k] : belly_pieces_;
    if (level) {
      upper_envelope(pieces, k < 2 ? under_wheels : under_belly, span, kProfileResolution_m, scratch_, profiles_[k]);
    } else {
      raise_to_envelope(pieces, kProfileResolution_m, scratch_, profiles_[k]);
    }
  }
  at_ = pose;
  cut_once_ = true;
}

void TrackTerrain::apply(Mechanism& car) {
  for (int k = 0; k < 2; ++k) replace_chain(k, *car.track[k], category::kTrack[k], category::kWheel[k]);
  replace_chain(2, *car.belly_ground, category::kBellyGround, category::kBelly);
}

// A chain is solid on its right-hand side; vertices from right to left give normals that point up.
void TrackTerrain::make_vertices(const b2Body& body, const Profile& profile) {
  constexpr float kClosest = 0.25f * 9 * b2_linearSlop * b2_linearSlop;  // (half the profile's resolution)²
  const float origin = to_units(at_.s_m) - body.GetPosition().x;
  vertices_.clear();
  auto add = [&](double s_m, double z_m) {
    const b2Vec2 vertex(origin + to_units(s_m), to_units(z_m));
    if (vertices_.empty() || b2DistanceSquared(vertices_.back(), vertex) > kClosest) vertices_.push_back(vertex);
  };
  for (auto segment = profile.rbegin(); segment != profile.rend(); ++segment) {
    add(segment->s1_m, segment->z1_m);
    add(segment->s0_m, segment->z0_m);
  }
}

// Whether a chain reaches as far as the car may drive before the next cut.
bool TrackTerrain::reaches(const std::vector<b2Vec2>& chain) const {
  const float spare = to_units(kSpare_m);
  return chain.front().x >= vertices_.front().x - spare && chain.back().x <= vertices_.back().x + spare;
}

// Whether all vertices of chain lie within tolerance_m of the new outline: inner ones of their new positions, ends of
// the new end segments' lines. Such a chain is kept or moved, since a new one costs more than the cut, and its contacts
// lose the impulses of the last step (warm starting).
bool TrackTerrain::fits(const std::vector<b2Vec2>& chain, double tolerance_m) const {
  if (chain.size() != vertices_.size() || !reaches(chain)) return false;
  const float tolerance = to_units(tolerance_m), closest = to_units(kProfileResolution_m);
  const std::size_t last = chain.size() - 1;
  if (chain[0].x < vertices_[1].x + closest || chain[last].x > vertices_[last - 1].x - closest) return false;
  for (std::size_t i = 1; i < last; ++i) {
    if (std::abs(chain[i].x - vertices_[i].x) > tolerance) return false;
    if (std::abs(chain[i].y - vertices_[i].y) > tolerance) return false;
  }
  return std::abs(height_on_line(vertices_[0], vertices_[1], chain[0].x) - chain[0].y) <= tolerance &&
         std::abs(height_on_line(vertices_[last], vertices_[last - 1], chain[last].x) - chain[last].y) <= tolerance;
}

// Moves the vertices of the chain at a tenth of the cost of a new one; its contacts keep their impulses. The ends keep
// their positions along the plane.
void TrackTerrain::adjust(int outline, b2Body& body) {
  const std::vector<b2Vec2>& chain = chains_[outline];
  const std::size_t last = chain.size() - 1;
  vertices_[0] = {chain[0].x, height_on_line(vertices_[0], vertices_[1], chain[0].x)};
  vertices_[last] = {chain[last].x, height_on_line(vertices_[last], vertices_[last - 1], chain[last].x)};
  auto& shape = *static_cast<b2ChainShape*>(fixtures_[outline]->GetShape());
  std::copy(vertices_.begin(), vertices_.end(), shape.m_vertices);
  shape.m_prevVertex = ghost_vertex(vertices_.front(), 1);
  shape.m_nextVertex = ghost_vertex(vertices_.back(), -1);
  // SetTransform makes Box2D update the bounding boxes of the body's fixtures.
  body.SetTransform(body.GetPosition(), body.GetAngle());
  chains_[outline] = vertices_;
}

void TrackTerrain::replace_chain(int outline, b2Body& body, std::uint16_t category, std::uint16_t meets) {
  make_vertices(body, profiles_[outline]);
  // The track has gone so far from the car that single precision no longer tells the vertices apart.
  if (vertices_.size() < 2) throw std::runtime_error("the simulation left the finite numbers");
  if (fits(chains_[outline], kChainTolerance_m)) return;
  if (fits(chains_[outline], kAdjust_m)) return adjust(outline, body);
  chains_[outline] = vertices_;
  b2ChainShape chain;
  chain.CreateChain(vertices_.data(), static_cast<int32>(vertices_.size()), ghost_vertex(vertices_.front(), 1),
                    ghost_vertex(vertices_.back(), -1));
  b2FixtureDef definition;
  definition.shape = &chain;
  definition.density = 0;
  definition.friction = 1;
  definition.filter.categoryBits = category;
  definition.filter.maskBits = meets;
  // Box2D recomputes the body's mass from its fixtures' densities, which are 0; the mass is therefore set back.
  b2MassData mass;
  body.GetMassData(&mass);
  if (fixtures_[outline] != nullptr) body.DestroyFixture(fixtures_[outline]);
  fixtures_[outline] = body.CreateFixture(&definition);
  if (body.GetType() == b2_dynamicBody) body.SetMassData(&mass);
}

double TrackTerrain::side_slope(int k, double s_m, double z_m) const {
  if (terrain_.ground() == nullptr) return 0;
  const GroundOutline::Ends edges = grounds_[k].ends(s_m);
  if (z_m > std::max(edges.from_z_m, edges.to_z_m) + kOnGround_m) return 0;
  return (edges.to_z_m - edges.from_z_m) / tyre_width_m_;
}

double TrackTerrain::belly_contact_y_m(double s_m) const {
  const double relative_m = s_m - at_.s_m;
  const ProfileSegment* best = nullptr;
  for (const ProfileSegment& segment : profiles_[2]) {
    if (relative_m < segment.s0_m - kProfileResolution_m || relative_m > segment.s1_m + kProfileResolution_m) continue;
    if (best == nullptr || std::max(segment.z0_m, segment.z1_m) > std::max(best->z0_m, best->z1_m)) best = &segment;
  }
  return best == nullptr ? 0 : 0.5 * (best->y_min_m + best->y_max_m);
}

}  // namespace foldcar
