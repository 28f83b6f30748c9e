// The body of a car, read from JSON.
#pragma once

#include "body_spec.h"
#include "json_reader.h"

namespace foldcar {

// The value of a body line, checked in full. InputError.
BodySpec read_body(JsonReader reader);

}  // namespace foldcar
