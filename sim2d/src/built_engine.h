// The engine that this program is built with: a file of sim2d/engines, as platformio.ini chooses.
#pragma once

#include <string>

#include "engine.h"

namespace foldcar {

const Engine& engine();

// Whether the engine takes this word, which stands before the program's command; it then is another engine, by its name
// too. To be called before engine().
bool take_engine_option(const std::string& word);
// What --help says of these words.
extern const char* const kEngineUsage;

}  // namespace foldcar
