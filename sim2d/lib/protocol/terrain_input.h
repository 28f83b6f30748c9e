// The terrain of a scene line, as docs/carsim.md describes it, with every limit.
#pragma once

#include <map>
#include <string>

#include "input_limits.h"
#include "json_reader.h"
#include "scene_spec.h"

namespace foldcar {

// Places and directions in a scene.
inline constexpr Limits kCoordinate_m{-1000, 1000};
inline constexpr Limits kHeading_rad{-100, 100};

// The limits of every kind's numbers by kind and key: "box.height_m".
std::map<std::string, Limits> terrain_limits();

// The key terrain of the scene that reader reads. Throws InputError.
TerrainSpec read_terrain(JsonReader& reader);

}  // namespace foldcar
