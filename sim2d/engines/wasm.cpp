// carsim as a WebAssembly module: the batch and step protocols as functions on lines, for pages and for Node.
//
// Strings are UTF-8 and end with 0. A returned string is valid until the next call; a null pointer is no answer.
#include <memory>
#include <optional>
#include <string>

#include "batch_session.h"
#include "built_engine.h"
#include "step_session.h"
#include "tables.h"

namespace {

std::string answer_text;
std::unique_ptr<foldcar::BatchSession> batch;
std::unique_ptr<foldcar::StepSession> step;

const char* returned(const std::optional<std::string>& text) {
  if (!text) return nullptr;
  answer_text = *text;
  return answer_text.c_str();
}

}  // namespace

extern "C" {

// Whether the engine takes this word; to be called before all others.
__attribute__((export_name("carsim_engine"))) bool carsim_engine(const char* word) {
  return foldcar::take_engine_option(word);
}

// What `carsim NAME` prints.
__attribute__((export_name("carsim_table"))) const char* carsim_table(const char* name) {
  const std::string table = name;
  if (table == "params") return returned(foldcar::parameters_object().dump());
  if (table == "metrics") return returned(foldcar::metrics_object().dump());
  if (table == "limits") return returned(foldcar::limits_object().dump());
  if (table == "--version") return returned(foldcar::version_object().dump());
  return nullptr;
}

// The answer of `carsim batch` to its input's line with this number, from 1.
__attribute__((export_name("carsim_batch"))) const char* carsim_batch(std::size_t number, const char* line) {
  if (!batch) batch = std::make_unique<foldcar::BatchSession>(foldcar::engine(), false);
  return returned(batch->answer(number, line));
}

// The answer of `carsim step` likewise.
__attribute__((export_name("carsim_step"))) const char* carsim_step(std::size_t number, const char* line) {
  if (!step) step = std::make_unique<foldcar::StepSession>(foldcar::engine());
  return returned(step->answer(number, line));
}

}  // extern "C"
