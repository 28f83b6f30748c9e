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

BlockSpec read_block(JsonReader& reader, BlockSpec::Kind kind) {
  BlockSpec block = rectangle<BlockSpec>(reader);
  block.kind = kind;
  // No arc over a chord is higher than half of it.
  const bool arc = kind == BlockSpec::Kind::kHalfRound;
  block.height_m = reader.number(
      "height_m", {kHeight_m.minimum, arc ? std::min(kHeight_m.maximum, 0.5 * block.length_m) : kHeight_m.maximum});
  return block;
}

HillSpec read_hill(JsonReader& reader) {
  HillSpec hill = placed<HillSpec>(reader);
  hill.heading_rad = reader.number("heading_rad", kHeading_rad);
  hill.sd_along_m = reader.number("sd_along_m", kSpread_m);
  hill.sd_across_m = reader.number("sd_across_m", kSpread_m);
  hill.height_m = reader.number("height_m", kHillHeight_m);
  return hill;
}

PotholeSpec read_pothole(JsonReader& reader) {
  PotholeSpec pothole = placed<PotholeSpec>(reader);
  pothole.radius_m = reader.number("radius_m", kEdge_m);
  pothole.depth_m = reader.number("depth_m", kHeight_m);
  pothole.edge_m = reader.number("edge_m", {kEdge_m.minimum, pothole.radius_m});
  return pothole;
}

RoughSpec read_rough(JsonReader& reader) {
  RoughSpec rough = rectangle<RoughSpec>(reader);
  rough.height_sd_m = reader.number("height_sd_m", kHeightSd_m);
  const double shorter_m = std::min(rough.length_m, rough.width_m);
  rough.correlation_m = reader.number("correlation_m", {0.001, std::max(0.001, shorter_m)});
  rough.seed = reader.integer("seed", 0, kLargestSeed);
  return rough;
}

PatchSpec read_patch(JsonReader& reader) {
  PatchSpec patch = rectangle<PatchSpec>(reader);
  patch.friction = reader.number("friction", kFriction);
  return patch;
}

}  // namespace

TerrainSpec read_terrain(JsonReader& reader) {
  TerrainSpec terrain;
  double nodes = 0;
  for (JsonReader& piece : reader.objects("terrain", 0, kMostPieces)) {
    using Kind = BlockSpec::Kind;
    switch (piece.choice("kind", {"box", "ramp", "half_round", "hill", "pothole", "rough", "patch"})) {
      case 0: terrain.blocks.push_back(read_block(piece, Kind::kBox)); break;
      case 1: terrain.blocks.push_back(read_block(piece, Kind::kRamp)); break;
      case 2: terrain.blocks.push_back(read_block(piece, Kind::kHalfRound)); break;
      case 3: terrain.hills.push_back(read_hill(piece)); break;
      case 4: terrain.potholes.push_back(read_pothole(piece)); break;
      case 5:
        terrain.roughs.push_back(read_rough(piece));
        nodes += Rough::node_count(terrain.roughs.back());
        if (nodes > kMostNodes) {
          piece.fail("correlation_m", "its grid of an eighth of that is too fine for the rectangle: the limit of a "
                                      "scene is " + std::to_string(static_cast<long>(kMostNodes)) + " nodes");
        }
        break;
      default: terrain.patches.push_back(read_patch(piece)); break;
    }
    piece.finish();
  }
  return terrain;
}

}  // namespace foldcar
