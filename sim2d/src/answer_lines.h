// Answers standard input line by line: what `carsim batch` and `carsim step` share.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>

namespace foldcar {

// The answer to a line, without an end of line; none to a line that calls for none. Lines are numbered from 1.
using LineAnswer = std::function<std::optional<std::string>(std::size_t number, const std::string& line)>;

// Serves standard input until its end: each answer is written, as one line, before the next line is read. Lines of
// white space are passed over. 0 if no answer is an error, else 2. std::runtime_error if the output cannot be written.
int answer_lines(const LineAnswer& answer);

}  // namespace foldcar
