#include "terrain_input.h"

#include <algorithm>

#include "rough.h"

namespace foldcar {
namespace {

const std::vector<std::string> kKinds = {"box", "ramp", "half_round", "hill", "pothole", "rough", "patch"};

// Keys that several kinds share.
template <typename Spec>
Spec placed(JsonReader& reader) {
  Spec spec;
  spec.x_m = reader.number("x_m");
  spec.y_m = reader.number("y_m");
  return spec;
}

template <typename Spec>
Spec rectangle(JsonReader& reader) {
  Spec spec = placed<Spec>(reader);
  spec.heading_rad = reader.number("heading_rad");
  spec.length_m = reader.number("length_m");
  spec.width_m = reader.number("width_m");
  return spec;
}

BlockSpec read_block(JsonReader& reader, BlockSpec::Kind kind) {
  BlockSpec block = rectangle<BlockSpec>(reader);
  block.kind = kind;
  // No arc over a chord is higher than half of it.
  const bool arc = kind == BlockSpec::Kind::kHalfRound;
  const Limits height_m = reader.limits("height_m");
  block.height_m = reader.number(
      "height_m", {height_m.minimum, arc ? std::min(height_m.maximum, 0.5 * block.length_m) : height_m.maximum});
  return block;
}

HillSpec read_hill(JsonReader& reader) {
  HillSpec hill = placed<HillSpec>(reader);
  hill.heading_rad = reader.number("heading_rad");
  hill.sd_along_m = reader.number("sd_along_m");
  hill.sd_across_m = reader.number("sd_across_m");
  hill.height_m = reader.number("height_m");
  return hill;
}

PotholeSpec read_pothole(JsonReader& reader) {
  PotholeSpec pothole = placed<PotholeSpec>(reader);
  pothole.radius_m = reader.number("radius_m");
  pothole.depth_m = reader.number("depth_m");
  pothole.edge_m = reader.number("edge_m", {reader.limits("edge_m").minimum, pothole.radius_m});
  return pothole;
}

RoughSpec read_rough(JsonReader& reader) {
  RoughSpec rough = rectangle<RoughSpec>(reader);
  rough.height_sd_m = reader.number("height_sd_m");
  const double shorter_m = std::min(rough.length_m, rough.width_m);
  rough.correlation_m = reader.number("correlation_m", {reader.limits("correlation_m").minimum, shorter_m});
  rough.seed = reader.integer("seed");
  return rough;
}

PatchSpec read_patch(JsonReader& reader) {
  PatchSpec patch = rectangle<PatchSpec>(reader);
  patch.friction = reader.number("friction");
  return patch;
}

}  // namespace

TerrainSpec read_terrain(JsonReader& reader) {
  TerrainSpec terrain;
  double nodes = 0;
  for (JsonReader& piece : reader.objects("terrain")) {
    using Kind = BlockSpec::Kind;
    const std::size_t kind = piece.choice("kind", kKinds);
    piece.narrow(kKinds[kind]);
    switch (kind) {
      case 0: terrain.blocks.push_back(read_block(piece, Kind::kBox)); break;
      case 1: terrain.blocks.push_back(read_block(piece, Kind::kRamp)); break;
      case 2: terrain.blocks.push_back(read_block(piece, Kind::kHalfRound)); break;
      case 3: terrain.hills.push_back(read_hill(piece)); break;
      case 4: terrain.potholes.push_back(read_pothole(piece)); break;
      case 5:
        terrain.roughs.push_back(read_rough(piece));
        nodes += Rough::node_count(terrain.roughs.back());
        if (nodes > piece.limits("nodes").maximum) {
          const long most = static_cast<long>(piece.limits("nodes").maximum);
          piece.fail("correlation_m", "its grid of an eighth of that is too fine for the rectangle: the limit of a "
                                      "scene is " + std::to_string(most) + " nodes");
        }
        break;
      default: terrain.patches.push_back(read_patch(piece)); break;
    }
    piece.finish();
  }
  return terrain;
}

}  // namespace foldcar
