// carsim: the native simulator program. docs/carsim.md describes what it reads and writes.
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "batch.h"
#include "built_engine.h"
#include "link.h"
#include "link_options.h"
#include "reader_watch.h"
#include "step.h"
#include "tables.h"

namespace {

constexpr char kUsage[] =
    "usage: carsim batch [--timing]              bodies, scenes and runs in, results out (JSON Lines)\n"
    "       carsim step                          the same for one trial at a time, advanced by its caller\n"
    "       carsim link (--pty | --tcp PORT | --replay FILE) --body FILE --scene FILE [--design FILE] [--params FILE]\n"
    "                   [--reality FILE] [--speedup N] [--put-back] [--record FILE]\n"
    "                                            a car with its whole firmware on a port, speaking MAVLink\n"
    "       carsim params                        the firmware's parameter table as JSON\n"
    "       carsim metrics                       the numbers of a run's result as JSON\n"
    "       carsim limits                        the limits of input numbers and a trial's own numbers as JSON\n"
    "       carsim --version                     the build, which changes whenever results can\n"
    "       carsim --help\n";

int usage_error(const std::string& problem) {
  std::fprintf(stderr, "carsim: %s\n%s%s", problem.c_str(), kUsage, foldcar::kEngineUsage);
  return 2;
}

int print(const nlohmann::ordered_json& value, int indent) {
  std::printf("%s\n", value.dump(indent).c_str());
  return std::fflush(stdout) == 0 ? 0 : 2;
}

int batch(const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    if (word != "--timing") return usage_error("batch: unknown option " + word);
  }
  return foldcar::run_batch(!words.empty());
}

int run(std::vector<std::string> words) {
  while (!words.empty() && foldcar::take_engine_option(words.front())) words.erase(words.begin());
  if (words.empty()) return usage_error("no command");
  const std::string& command = words.front();
  foldcar::end_without_reader();
  if (command == "batch") return batch({words.begin() + 1, words.end()});
  if (command == "link") return foldcar::run_link({words.begin() + 1, words.end()});
  if (words.size() > 1) return usage_error(command + " takes no further words");
  if (command == "step") return foldcar::run_step();
  if (command == "params") return print(foldcar::parameters_object(), 1);
  if (command == "metrics") return print(foldcar::metrics_object(), 1);
  if (command == "limits") return print(foldcar::limits_object(), 1);
  if (command == "--version") return print(foldcar::version_object(), -1);
  if (command == "--help" || command == "-h") {
    std::fputs(kUsage, stdout);
    std::fputs(foldcar::kEngineUsage, stdout);
    return 0;
  }
  return usage_error("unknown command " + command);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run({argv + 1, argv + argc});
  } catch (const foldcar::LinkUsageError& error) {
    return usage_error(error.what());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "carsim: %s\n", error.what());
    return 2;
  }
}
