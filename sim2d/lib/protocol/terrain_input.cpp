#include "terrain_input.h"

#include <algorithm>

#include "rough.h"

namespace foldcar {
namespace {

constexpr std::size_t kMostPieces = 10000;
// The grids of a scene's rough ground take four bytes a node.
constexpr double kMostNodes = 4e6;

constexpr Limits kCoordinate_m{-1000, 1000};
constexpr Limits kHeading_rad{-100, 100};
constexpr Limits kSide_m{0.001, 100};
constexpr Limits kHeight_m{0.0001, 10};
constexpr Limits kHillHeight_m{-10, 10};
constexpr Limits kSpread_m{0.005, 100};
constexpr Limits kEdge_m{0.002, 100};
constexpr Limits kHeightSd_m{0, 1};
constexpr Limits kFriction{0, 5};
constexpr int kLargestSeed = 2147483647;

// Keys that several kinds share.
template <typename Spec>
Spec placed(JsonReader& reader) {
  Spec spec;
  spec.x_m = reader.number("x_m", kCoordinate_m);
  spec.y_m = reader.number("y_m", kCoordinate_m);
  return spec;
}

template <typename Spec>
Spec rectangle(JsonReader& reader) {
  Spec spec = placed<Spec>(reader);
  spec.heading_rad = reader.number("heading_rad", kHeading_rad);
  spec.length_m = reader.number("length_m", kSide_m);
  spec.width_m = reader.number("width_m", kSide_m);
  return spec;
}

template <BlockSpec::Kind kind>
void read_block(JsonReader& reader, TerrainSpec& terrain) {
  BlockSpec block = rectangle<BlockSpec>(reader);
  block.kind = kind;
  // No arc over a chord is higher than half of it.
  constexpr bool arc = kind == BlockSpec::Kind::kHalfRound;
  block.height_m = reader.number(
      "height_m", {kHeight_m.minimum, arc ? std::min(kHeight_m.maximum, 0.5 * block.length_m) : kHeight_m.maximum});
  terrain.blocks.push_back(block);
}

void read_hill(JsonReader& reader, TerrainSpec& terrain) {
  HillSpec hill = placed<HillSpec>(reader);
  hill.heading_rad = reader.number("heading_rad", kHeading_rad);
  hill.sd_along_m = reader.number("sd_along_m", kSpread_m);
  hill.sd_across_m = reader.number("sd_across_m", kSpread_m);
  hill.height_m = reader.number("height_m", kHillHeight_m);
  terrain.hills.push_back(hill);
}

void read_pothole(JsonReader& reader, TerrainSpec& terrain) {
  PotholeSpec pothole = placed<PotholeSpec>(reader);
  pothole.radius_m = reader.number("radius_m", kEdge_m);
  pothole.depth_m = reader.number("depth_m", kHeight_m);
  pothole.edge_m = reader.number("edge_m", {kEdge_m.minimum, pothole.radius_m});
  terrain.potholes.push_back(pothole);
}

void read_rough(JsonReader& reader, TerrainSpec& terrain) {
  RoughSpec rough = rectangle<RoughSpec>(reader);
  rough.height_sd_m = reader.number("height_sd_m", kHeightSd_m);
  const double shorter_m = std::min(rough.length_m, rough.width_m);
  rough.correlation_m = reader.number("correlation_m", {0.001, std::max(0.001, shorter_m)});
  rough.seed = reader.integer("seed", 0, kLargestSeed);
  terrain.roughs.push_back(rough);
  double nodes = 0;
  for (const RoughSpec& each : terrain.roughs) nodes += Rough::node_count(each);
  if (nodes > kMostNodes) {
    reader.fail("correlation_m", "its grid of an eighth of that is too fine for the rectangle: the limit of a scene is " +
                                     std::to_string(static_cast<long>(kMostNodes)) + " nodes");
  }
}

void read_patch(JsonReader& reader, TerrainSpec& terrain) {
  PatchSpec patch = rectangle<PatchSpec>(reader);
  patch.friction = reader.number("friction", kFriction);
  terrain.patches.push_back(patch);
}

// Every kind of terrain: its name in a scene and what reads its keys, all but "kind", into the specification.
struct TerrainKind {
  const char* name;
  void (*read)(JsonReader& reader, TerrainSpec& terrain);
};

constexpr TerrainKind kKinds[] = {
    {"box", read_block<BlockSpec::Kind::kBox>},
    {"ramp", read_block<BlockSpec::Kind::kRamp>},
    {"half_round", read_block<BlockSpec::Kind::kHalfRound>},
    {"hill", read_hill},
    {"pothole", read_pothole},
    {"rough", read_rough},
    {"patch", read_patch},
};

}  // namespace

TerrainSpec read_terrain(JsonReader& reader) {
  std::vector<std::string> names;
  for (const TerrainKind& kind : kKinds) names.emplace_back(kind.name);
  TerrainSpec terrain;
  for (JsonReader& piece : reader.objects("terrain", 0, kMostPieces)) {
    kKinds[piece.choice("kind", names)].read(piece, terrain);
    piece.finish();
  }
  return terrain;
}

}  // namespace foldcar
