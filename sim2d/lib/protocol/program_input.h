// Reads a scene's program: conditions and values in postfix order, as docs/carsim.md describes them.
#pragma once

#include "json_reader.h"
#include "program_spec.h"

namespace foldcar {

// Throws InputError, which names the place of a term that is unknown or lacks its operands.
ProgramSpec read_program(JsonReader reader);

}  // namespace foldcar
