#include "batch.h"

#include <chrono>
#include <cstdio>

#include "answer_lines.h"
#include "batch_session.h"
#include "built_engine.h"

namespace foldcar {
namespace {

void report_timing(const BatchSession& session, double wall_s) {
  const Stopwatch& watch = session.stopwatch();
  const nlohmann::ordered_json timing = {{"wall_s", wall_s},
                                         {"simulated_s", session.simulated_s()},
                                         {"physics_s", watch.physics_s},
                                         {"terrain_s", watch.terrain_s},
                                         {"firmware_s", watch.firmware_s}};
  std::fprintf(stderr, "%s\n", nlohmann::ordered_json{{"timing", timing}}.dump().c_str());
}

}  // namespace

int run_batch(bool timing) {
  const auto start = std::chrono::steady_clock::now();
  BatchSession session(engine(), timing);
  const int code =
      answer_lines([&](std::size_t number, const std::string& line) { return session.answer(number, line); });
  if (timing) {
    report_timing(session, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return code;
}

}  // namespace foldcar
