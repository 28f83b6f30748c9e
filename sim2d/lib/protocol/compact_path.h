// The path of a run as a few hundred characters, for those who keep the paths of many runs.
#pragma once

#include <string>
#include <vector>

#include "trial.h"

namespace foldcar {

// Columns one after the other without the time: x, y, z in units of 0.5 mm, heading (which goes on beyond a half turn),
// pitch, roll and each hinge in units of 2 mrad, rounded. A column is its values differenced twice, each with 0 before
// the first; integers are zigzag LEB128 (7 bits a byte, lowest first, the top bit says that more follow); the bytes are
// base64. host/foldcar/simulation/compact_path.py does the same.
std::string compact_path(const std::vector<PathRow>& path);

}  // namespace foldcar
