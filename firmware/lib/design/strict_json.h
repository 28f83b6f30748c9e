// Whether a text is JSON as RFC 8259 writes it, of the kind that every JSON library reads alike.
//
// Libraries differ in what they accept beside JSON: single quotes, +1, .5, comments, a byte order mark, text behind the value.
// A text that passes here means the same to all of them.
#pragma once

#include <cstddef>

namespace foldcar {

// Whether text, of size bytes, is one object in valid UTF-8, with space around it at most. Stricter than the RFC: no more than
// 8 values inside each other, no number of more than 32 characters or with an exponent of more than two digits, no \u0000.
bool is_strict_json_object(const char* text, std::size_t size);

}  // namespace foldcar
