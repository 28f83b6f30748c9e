// The terrain of a scene line, as docs/carsim.md describes it, with every limit.
#pragma once

#include "json_reader.h"
#include "scene_spec.h"

namespace foldcar {

// The key terrain of the scene that reader reads. Throws InputError.
TerrainSpec read_terrain(JsonReader& reader);

}  // namespace foldcar
