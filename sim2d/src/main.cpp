// carsim: the native simulator program. docs/carsim.md describes what it reads and writes.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "batch.h"
#include "build_id.h"
#include "firmware_id.h"
#include "link.h"
#include "link_options.h"
#include "metrics.h"
#include "parameter_table.h"
#include "printed_number.h"
#include "step.h"

namespace {

constexpr char kUsage[] =
    "usage: carsim batch [--jobs N] [--timing]   bodies, scenes and runs in, results out (JSON Lines)\n"
    "       carsim step                          the same for one trial at a time, advanced by its caller\n"
    "       carsim link (--pty | --tcp PORT | --replay FILE) --body FILE --scene FILE [--design FILE] [--params FILE]\n"
    "                   [--speedup N] [--put-back] [--record FILE]\n"
    "                                            a car with its whole firmware on a port, speaking MAVLink\n"
    "       carsim params                        the firmware's parameter table as JSON\n"
    "       carsim metrics                       what a run is measured by, as JSON\n"
    "       carsim --version                     the build, which changes whenever results can\n"
    "       carsim --help\n";
constexpr int kMostJobs = 256;

int usage_error(const std::string& problem) {
  std::fprintf(stderr, "carsim: %s\n%s", problem.c_str(), kUsage);
  return 2;
}

int print(const nlohmann::ordered_json& value, int indent) {
  std::printf("%s\n", value.dump(indent).c_str());
  return std::fflush(stdout) == 0 ? 0 : 2;
}

const char* text(foldcar::ParameterKind kind) {
  switch (kind) {
    case foldcar::ParameterKind::kInteger: return "integer";
    case foldcar::ParameterKind::kSign: return "sign";
    case foldcar::ParameterKind::kReal: break;
  }
  return "real";
}

int print_parameters() {
  nlohmann::ordered_json table = nlohmann::ordered_json::array();
  for (const foldcar::ParameterInfo& info : foldcar::parameter_table()) {
    table.push_back({{"name", info.name},
                     {"unit", info.unit},
                     {"kind", text(info.kind)},
                     {"minimum", foldcar::as_printed(info.minimum)},
                     {"maximum", foldcar::as_printed(info.maximum)},
                     {"default", foldcar::as_printed(info.default_value)},
                     {"help", info.help}});
  }
  return print(table, 1);
}

int print_metrics() {
  nlohmann::ordered_json table = nlohmann::ordered_json::array();
  for (const foldcar::MetricInfo& metric : foldcar::kMetrics) {
    table.push_back({{"name", metric.name},
                     {"unit", metric.unit},
                     {"optional", metric.optional()},
                     {"help", metric.help}});
  }
  return print(table, 1);
}

nlohmann::ordered_json version() {
  return {{"program", "carsim"}, {"build", FOLDCAR_BUILD_ID}, {"firmware", FOLDCAR_FIRMWARE_ID}};
}

int batch(const std::vector<std::string>& words) {
  foldcar::BatchOptions options;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == "--timing") {
      options.timing = true;
    } else if (words[i] == "--jobs" && i + 1 < words.size()) {
      char* end = nullptr;
      const std::string& count = words[++i];
      const long jobs = std::strtol(count.c_str(), &end, 10);
      if (count.empty() || *end != '\0' || jobs < 1 || jobs > kMostJobs) {
        return usage_error("--jobs: " + count + " is not a number from 1 to " + std::to_string(kMostJobs));
      }
      options.jobs = static_cast<int>(jobs);
    } else {
      return usage_error("batch: unknown or incomplete option " + words[i]);
    }
  }
  return foldcar::run_batch(options, STDIN_FILENO, STDOUT_FILENO);
}

int run(const std::vector<std::string>& words) {
  if (words.empty()) return usage_error("no command");
  const std::string& command = words.front();
  if (command == "batch") return batch({words.begin() + 1, words.end()});
  if (command == "link") return foldcar::run_link({words.begin() + 1, words.end()});
  if (words.size() > 1) return usage_error(command + " takes no further words");
  if (command == "step") return foldcar::run_step();
  if (command == "params") return print_parameters();
  if (command == "metrics") return print_metrics();
  if (command == "--version") return print(version(), -1);
  if (command == "--help" || command == "-h") {
    std::fputs(kUsage, stdout);
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
