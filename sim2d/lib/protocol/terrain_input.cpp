#include "terrain_input.h"

#include <algorithm>

#include "rough.h"

namespace foldcar {
namespace {

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

template <BlockSpec::Kind kind>
void read_block(JsonReader& reader, TerrainSpec& terrain) {
  BlockSpec block = rectangle<BlockSpec>(reader);
  block.kind = kind;
  // No arc over a chord is higher than half of it.
  constexpr bool arc = kind == BlockSpec::Kind::kHalfRound;
  const Limits height_m = reader.limits("height_m");
  block.height_m = reader.number(
      "height_m", {height_m.minimum, arc ? std::min(height_m.maximum, 0.5 * block.length_m) : height_m.maximum});
  terrain.blocks.push_back(block);
}

void read_hill(JsonReader& reader, TerrainSpec& terrain) {
  HillSpec hill = placed<HillSpec>(reader);
  hill.heading_rad = reader.number("heading_rad");
  hill.sd_along_m = reader.number("sd_along_m");
  hill.sd_across_m = reader.number("sd_across_m");
  hill.height_m = reader.number("height_m");
  terrain.hills.push_back(hill);
}

void read_pothole(JsonReader& reader, TerrainSpec& terrain) {
  PotholeSpec pothole = placed<PotholeSpec>(reader);
  pothole.radius_m = reader.number("radius_m");
  pothole.depth_m = reader.number("depth_m");
  pothole.edge_m = reader.number("edge_m", {reader.limits("edge_m").minimum, pothole.radius_m});
  terrain.potholes.push_back(pothole);
}

void read_rough(JsonReader& reader, TerrainSpec& terrain) {
  RoughSpec rough = rectangle<RoughSpec>(reader);
  rough.height_sd_m = reader.number("height_sd_m");
  const double shorter_m = std::min(rough.length_m, rough.width_m);
  const double least_m = reader.limits("correlation_m").minimum;
  rough.correlation_m = reader.number("correlation_m", {least_m, std::max(least_m, shorter_m)});
  rough.seed = reader.integer("seed");
  terrain.roughs.push_back(rough);
  double nodes = 0;
  for (const RoughSpec& each : terrain.roughs) nodes += Rough::node_count(each);
  const double most_nodes = reader.limits("nodes").maximum;
  if (nodes > most_nodes) {
    reader.fail("correlation_m", "its grid of an eighth of that is too fine for the rectangle: the limit of a scene is " +
                                     std::to_string(static_cast<long>(most_nodes)) + " nodes");
  }
}

void read_patch(JsonReader& reader, TerrainSpec& terrain) {
  PatchSpec patch = rectangle<PatchSpec>(reader);
  patch.friction = reader.number("friction");
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
  for (JsonReader& piece : reader.objects("terrain")) {
    const std::size_t kind = piece.choice("kind", names);
    piece.narrow(names[kind]);
    kKinds[kind].read(piece, terrain);
    piece.finish();
  }
  return terrain;
}

}  // namespace foldcar
