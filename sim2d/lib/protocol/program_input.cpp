#include "program_input.h"

#include <map>

namespace foldcar {
namespace {

using nlohmann::json;
using Kind = Term::Kind;

constexpr std::size_t kMostTerms = 1000, kMostEndings = 100, kMostRecords = 100, kMostCorners = 1000;

// What an operator takes, from the bottom of the stack to its top, and gives: n for a number, t for a truth.
struct Operator {
  Kind kind;
  const char* takes;
  char gives;
};

const std::map<std::string, Operator>& operators() {
  static const std::map<std::string, Operator> kOperators = {
      {"x_m", {Kind::kX, "", 'n'}},
      {"y_m", {Kind::kY, "", 'n'}},
      {"rise_m", {Kind::kRise, "", 'n'}},
      {"heading_rad", {Kind::kHeading, "", 'n'}},
      {"pitch_rad", {Kind::kPitch, "", 'n'}},
      {"roll_rad", {Kind::kRoll, "", 'n'}},
      {"speed_m_s", {Kind::kSpeed, "", 'n'}},
      {"yaw_rate_rad_s", {Kind::kYawRate, "", 'n'}},
      {"energy_j", {Kind::kEnergy, "", 'n'}},
      {"time_s", {Kind::kTime, "", 'n'}},
      {"negate", {Kind::kNegate, "n", 'n'}},
      {"abs", {Kind::kAbs, "n", 'n'}},
      {"wrap_rad", {Kind::kWrap, "n", 'n'}},
      {"not", {Kind::kNot, "t", 't'}},
      {"+", {Kind::kAdd, "nn", 'n'}},
      {"-", {Kind::kSubtract, "nn", 'n'}},
      {"*", {Kind::kMultiply, "nn", 'n'}},
      {"/", {Kind::kDivide, "nn", 'n'}},
      {"min", {Kind::kMin, "nn", 'n'}},
      {"max", {Kind::kMax, "nn", 'n'}},
      {"<", {Kind::kLess, "nn", 't'}},
      {"<=", {Kind::kLessEqual, "nn", 't'}},
      {">", {Kind::kGreater, "nn", 't'}},
      {">=", {Kind::kGreaterEqual, "nn", 't'}},
      {"and", {Kind::kAnd, "tt", 't'}},
      {"or", {Kind::kOr, "tt", 't'}},
      {"distance_m", {Kind::kDistance, "nnn", 'n'}},
      {"distance_from_m", {Kind::kDistanceFrom, "nnnnnn", 'n'}},
      {"in_disc", {Kind::kInDisc, "nnn", 't'}},
  };
  return kOperators;
}

// The corners of a polygon: an array of x and y in turn (m).
std::vector<double> read_corners(const JsonReader& reader, const std::string& key, const json& value) {
  if (value.size() < 6 || value.size() % 2 != 0 || value.size() > 2 * kMostCorners) {
    reader.fail(key, "must be x and y of 3 to " + std::to_string(kMostCorners) + " corners");
  }
  std::vector<double> corners;
  for (const json& number : value) {
    if (!number.is_number()) reader.fail(key, "must be numbers, not " + number.dump());
    corners.push_back(number.get<double>());
  }
  return corners;
}

// Reads an expression in postfix order and checks it: `types` is the stack of operands' types while it is evaluated (n
// number, t truth). At the end a condition must leave one truth; a record's value one number, one truth or three
// numbers.
Expression read_expression(JsonReader& reader, const char* key, bool condition) {
  const json& value = reader.value(key);
  if (!value.is_array()) reader.fail(key, "must be an array of terms in postfix order");
  if (value.size() > kMostTerms) reader.fail(key, "has more than " + std::to_string(kMostTerms) + " terms");
  Expression expression;
  std::string types;
  for (std::size_t i = 0; i < value.size(); ++i) {
    const json& token = value[i];
    const std::string place = std::string(key) + "[" + std::to_string(i) + "]";
    Term term;
    if (token.is_number() || token.is_boolean()) {
      term.number = token.is_number() ? token.get<double>() : token.get<bool>();
      types += token.is_number() ? 'n' : 't';
    } else if (token.is_array()) {
      term.kind = Kind::kInPolygon;
      term.polygon_m = read_corners(reader, place, token);
      types += 't';
    } else {
      const auto found = token.is_string() ? operators().find(token.get<std::string>()) : operators().end();
      if (found == operators().end()) reader.fail(place, "is no number, truth, polygon or operator: " + token.dump());
      const std::string takes = found->second.takes;
      if (types.size() < takes.size() || types.substr(types.size() - takes.size()) != takes) {
        reader.fail(place, token.dump() + " lacks its operands");
      }
      term.kind = found->second.kind;
      types.resize(types.size() - takes.size());
      types += found->second.gives;
    }
    expression.terms.push_back(std::move(term));
  }
  expression.truth = types == "t";
  expression.vector = types == "nnn";
  if (condition ? !expression.truth : !expression.truth && !expression.vector && types != "n") {
    reader.fail(key, condition ? "leaves no truth" : "leaves neither one number or truth nor three numbers");
  }
  return expression;
}

RecordSpec read_record(JsonReader& reader) {
  RecordSpec record;
  record.name = reader.string("name");
  record.kind = static_cast<RecordSpec::Kind>(reader.choice("kind", {"initial", "final", "series"}));
  if (reader.has("constant")) {
    record.constant = reader.value("constant").dump();
  } else {
    record.value = read_expression(reader, "value", false);
  }
  reader.finish();
  return record;
}

}  // namespace

ProgramSpec read_program(JsonReader reader) {
  ProgramSpec program;
  for (JsonReader& ending : reader.objects("endings", 0, kMostEndings)) {
    EndingSpec spec;
    spec.when = read_expression(ending, "when", true);
    spec.passed = ending.choice("outcome", {"terminated", "passed"}) == 1;
    ending.finish();
    program.endings.push_back(std::move(spec));
  }
  if (!reader.is_null("time_limit_s")) program.time_limit_s = reader.number("time_limit_s");
  if (!reader.is_null("verdict")) program.verdict = read_expression(reader, "verdict", true);
  for (JsonReader& record : reader.objects("records", 0, kMostRecords)) program.records.push_back(read_record(record));
  program.step_s = reader.number("step_s");
  reader.finish();
  return program;
}

}  // namespace foldcar
