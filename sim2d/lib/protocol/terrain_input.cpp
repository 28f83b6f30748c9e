#include "terrain_input.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

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
                                     std::to_string(static_cast<std::int64_t>(most_nodes)) + " nodes");
  }
}

void read_patch(JsonReader& reader, TerrainSpec& terrain) {
  PatchSpec patch = rectangle<PatchSpec>(reader);
  patch.friction = reader.number("friction");
  terrain.patches.push_back(patch);
}

constexpr Limits kSide_m{0.001, 100};
constexpr Limits kHeight_m{0.0001, 10};
constexpr Limits kSpread_m{0.005, 100};
constexpr Limits kEdge_m{0.002, 100};

using Row = std::pair<const char*, Limits>;

std::vector<Row> with_place(std::vector<Row> rows, bool turns = true) {
  rows.insert(rows.end(), {{"x_m", kCoordinate_m}, {"y_m", kCoordinate_m}});
  if (turns) rows.emplace_back("heading_rad", kHeading_rad);
  return rows;
}

std::vector<Row> with_sides(std::vector<Row> rows) {
  rows.insert(rows.end(), {{"length_m", kSide_m}, {"width_m", kSide_m}});
  return with_place(std::move(rows));
}

// Every kind of terrain: its name in a scene, what reads its keys, all but "kind", into the specification, and the
// limits of these.
struct TerrainKind {
  const char* name;
  void (*read)(JsonReader& reader, TerrainSpec& terrain);
  std::vector<Row> limits;
};

const std::vector<TerrainKind>& kinds() {
  static const std::vector<TerrainKind> table = {
      {"box", read_block<BlockSpec::Kind::kBox>, with_sides({{"height_m", kHeight_m}})},
      {"ramp", read_block<BlockSpec::Kind::kRamp>, with_sides({{"height_m", kHeight_m}})},
      {"half_round", read_block<BlockSpec::Kind::kHalfRound>, with_sides({{"height_m", kHeight_m}})},
      {"hill", read_hill,
       with_place({{"sd_along_m", kSpread_m},
                   {"sd_across_m", kSpread_m},
                   {"height_m", {-kHeight_m.maximum, kHeight_m.maximum}}})},
      {"pothole", read_pothole,
       with_place({{"radius_m", kEdge_m}, {"depth_m", kHeight_m}, {"edge_m", kEdge_m}}, false)},
      {"rough", read_rough,
       with_sides({{"height_sd_m", {0, 1}},
                   {"correlation_m", kSide_m},
                   {"seed", {0, 2147483647}},
                   // Of all grids of a scene's rough ground together; a node takes four bytes.
                   {"nodes", {0, 4e6}}})},
      {"patch", read_patch, with_sides({{"friction", {0, 5}}})},
  };
  return table;
}

}  // namespace

std::map<std::string, Limits> terrain_limits() {
  std::map<std::string, Limits> found;
  for (const TerrainKind& kind : kinds()) {
    for (const auto& [key, limits] : kind.limits) found[std::string(kind.name) + "." + key] = limits;
  }
  return found;
}

TerrainSpec read_terrain(JsonReader& reader) {
  std::vector<std::string> names;
  for (const TerrainKind& kind : kinds()) names.emplace_back(kind.name);
  TerrainSpec terrain;
  for (JsonReader& piece : reader.objects("terrain")) {
    const std::size_t kind = piece.choice("kind", names);
    piece.narrow(names[kind]);
    kinds()[kind].read(piece, terrain);
    piece.finish();
  }
  return terrain;
}

}  // namespace foldcar
