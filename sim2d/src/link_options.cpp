#include "link_options.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "batch_input.h"
#include "car_json.h"
#include "reality.h"

namespace foldcar {
namespace {

constexpr double kMaxSpeedup = 1e6;
constexpr long kLargestPort = 65535;

std::string content_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::string content{std::istreambuf_iterator<char>(in), {}};
  if (!in || in.bad()) throw InputError(file + ": cannot be read");
  return content;
}

template <typename Read>
auto from_file(const std::string& file, Read read) {
  const std::string content = content_of(file);
  try {
    return read(content);
  } catch (const InputError& error) {
    throw InputError(file + ": " + error.what());
  }
}

// An object of parameters, each within its limits.
std::vector<std::pair<std::string, float>> read_parameters(const std::string& content) {
  const nlohmann::json object = parse_object(content);
  std::vector<std::pair<std::string, float>> values;
  Parameters parameters;
  for (const auto& [name, value] : JsonReader(object, "parameters").numbers()) {
    const auto as_float = static_cast<float>(value);
    const SetResult result = parameters.set(name.c_str(), as_float);
    if (result != SetResult::kOk) throw InputError(name + " " + text(result) + ": " + object[name].dump());
    values.emplace_back(name, as_float);
  }
  return values;
}

double number(const std::string& option, const std::string& text, double smallest, double largest) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !(value >= smallest && value <= largest)) {
    throw LinkUsageError(option + ": " + text + " is not a number from " + nlohmann::json(smallest).dump() + " to " +
                         nlohmann::json(largest).dump());
  }
  return value;
}

// What read makes of each line. Throws InputError, which names the line if there are several.
template <typename Read>
auto each_line(const std::string& content, Read read) {
  std::vector<decltype(read(nlohmann::json()))> parts;
  std::istringstream lines(content);
  std::string line;
  while (std::getline(lines, line)) {
    try {
      parts.push_back(read(parse_object(line)));
    } catch (const InputError& error) {
      if (parts.empty()) throw;
      throw InputError("line " + std::to_string(parts.size() + 1) + ": " + error.what());
    }
  }
  if (parts.empty()) throw InputError("has no line");
  return parts;
}

// The worlds of one body in each scene, with a reality for each scene if there is a file of them.
std::vector<LinkedWorld> read_worlds(const std::string& body_file, const std::string& scene_file,
                                     const std::string& reality_file) {
  const auto bodies = from_file(body_file, [](const std::string& text) { return each_line(text, read_body); });
  const auto scenes = from_file(scene_file, [](const std::string& text) { return each_line(text, read_scene); });
  if (bodies.size() != 1) throw InputError(body_file + ": has " + std::to_string(bodies.size()) + " bodies; give one");
  std::vector<Reality> realities(scenes.size());
  if (!reality_file.empty()) {
    realities = from_file(reality_file, [](const std::string& text) {
      return each_line(text, [](const nlohmann::json& line) { return read_reality(JsonReader(line, "reality")); });
    });
  }
  if (realities.size() != scenes.size()) {
    throw InputError(reality_file + ": has " + std::to_string(realities.size()) + " realities for the " +
                     std::to_string(scenes.size()) + " scenes of " + scene_file + "; give one for each");
  }
  std::vector<LinkedWorld> worlds;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    worlds.push_back({real_body(bodies[0], realities[i]), real_scene(scenes[i], realities[i])});
  }
  return worlds;
}

}  // namespace

LinkOptions read_link_options(const std::vector<std::string>& words) {
  std::map<std::string, std::string> values;
  LinkOptions options;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--pty") {
      options.pty = true;
    } else if (word == "--put-back") {
      options.car.put_back = true;
    } else if (word == "--tcp" || word == "--speedup" || word == "--body" || word == "--scene" || word == "--design" ||
               word == "--params" || word == "--reality" || word == "--record" || word == "--replay") {
      if (i + 1 == words.size()) throw LinkUsageError("link: " + word + " needs a value");
      if (!values.emplace(word, words[++i]).second) throw LinkUsageError("link: " + word + " is given twice");
    } else {
      throw LinkUsageError("link: unknown option " + word);
    }
  }
  if (values.count("--tcp") != 0) {
    const double port = number("--tcp", values["--tcp"], 0, kLargestPort);
    if (port != std::floor(port)) throw LinkUsageError("--tcp: " + values["--tcp"] + " is not a whole number");
    options.tcp_port = static_cast<int>(port);
  }
  if (values.count("--speedup") != 0) options.speedup = number("--speedup", values["--speedup"], 0.01, kMaxSpeedup);
  options.record = values["--record"];
  options.replay = values["--replay"];
  const int places = (options.pty ? 1 : 0) + (options.tcp_port >= 0 ? 1 : 0) + (options.replay.empty() ? 0 : 1);
  if (places != 1) throw LinkUsageError("link: needs one of --pty, --tcp PORT and --replay FILE");
  if (values["--body"].empty() || values["--scene"].empty()) {
    throw LinkUsageError("link: needs --body FILE and --scene FILE");
  }
  options.worlds = read_worlds(values["--body"], values["--scene"], values["--reality"]);
  if (!values["--design"].empty()) options.car.design = read_car_json(content_of(values["--design"]));
  // Parameters that are given describe the car by themselves; with neither, it is a new board.
  if (values["--design"].empty() && values["--params"].empty()) options.car.design.source = DesignSource::kMissing;
  if (!values["--params"].empty()) options.car.stored_parameters = from_file(values["--params"], read_parameters);
  return options;
}

}  // namespace foldcar
