#include "strict_json.h"

#include <cstdint>
#include <cstring>

namespace foldcar {
namespace {

constexpr int kDeepest = 8;
constexpr std::ptrdiff_t kLongestNumber = 32;

bool is_digit(int c) { return c >= '0' && c <= '9'; }

// Recursive-descent parser. A method named after a part of JSON skips this part and returns whether it was there and
// well formed; after false the position does not matter.
class Checker {
 public:
  Checker(const char* text, std::size_t size) : at_(text), end_(text + size) {}

  bool only_object() {
    space();
    if (peek() != '{' || !value(1)) return false;
    space();
    return at_ == end_;
  }

 private:
  int peek() const { return at_ < end_ ? static_cast<unsigned char>(*at_) : -1; }

  bool take(char c) {
    if (peek() != c) return false;
    ++at_;
    return true;
  }

  void space() {
    while (peek() == ' ' || peek() == '\n' || peek() == '\r' || peek() == '\t') ++at_;
  }

  bool word(const char* wanted) {
    for (; *wanted != '\0'; ++wanted) {
      if (!take(*wanted)) return false;
    }
    return true;
  }

  bool value(int depth) {
    switch (peek()) {
      case '{': return depth <= kDeepest && list('{', '}', depth);
      case '[': return depth <= kDeepest && list('[', ']', depth);
      case '"': return string();
      case 't': return word("true");
      case 'f': return word("false");
      case 'n': return word("null");
      default: return number();
    }
  }

  // An object or an array.
  bool list(char first, char last, int depth) {
    if (!take(first)) return false;
    space();
    if (take(last)) return true;
    do {
      space();
      if (first == '{') {
        if (!string()) return false;
        space();
        if (!take(':')) return false;
        space();
      }
      if (!value(depth + 1)) return false;
      space();
    } while (take(','));
    return take(last);
  }

  bool digits() {
    if (!is_digit(peek())) return false;
    while (is_digit(peek())) ++at_;
    return true;
  }

  bool number() {
    const char* const first = at_;
    take('-');
    if (!take('0') && !digits()) return false;
    if (take('.') && !digits()) return false;
    if (take('e') || take('E')) {
      if (!take('+')) take('-');
      const char* const exponent = at_;
      if (!digits() || at_ - exponent > 2) return false;
    }
    return at_ - first <= kLongestNumber;
  }

  bool string() {
    if (!take('"')) return false;
    while (!take('"')) {
      if (take('\\')) {
        if (!escape()) return false;
      } else if (!character()) {
        return false;
      }
    }
    return true;
  }

  // What follows a backslash: one of JSON's letters, or u and a UTF-16 code unit; surrogates only in pairs, and no
  // zero.
  bool escape() {
    if (!take('u')) {
      if (peek() <= 0 || std::strchr("\"\\/bfnrt", peek()) == nullptr) return false;
      ++at_;
      return true;
    }
    const std::int32_t first = hexadecimal();
    if (first <= 0 || (first >= 0xDC00 && first < 0xE000)) return false;
    if (first < 0xD800 || first >= 0xE000) return true;
    // The first half of a pair.
    if (!take('\\') || !take('u')) return false;
    const std::int32_t second = hexadecimal();
    return second >= 0xDC00 && second < 0xE000;
  }

  // Four hexadecimal digits; -1 if there are fewer.
  std::int32_t hexadecimal() {
    std::int32_t number = 0;
    for (int i = 0; i < 4; ++i, ++at_) {
      const int c = peek();
      if (is_digit(c)) {
        number = 16 * number + c - '0';
      } else if ((c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F')) {
        number = 16 * number + (c | 0x20) - 'a' + 10;
      } else {
        return -1;
      }
    }
    return number;
  }

  // Skips one character in UTF-8; returns false if it is malformed or a control character. Table 3-7 of the Unicode
  // standard has the limits of the second byte.
  bool character() {
    const int first = peek();
    if (first < 0x20) return false;
    ++at_;
    if (first < 0x80) return true;
    if (first < 0xC2 || first > 0xF4) return false;
    const int more = first < 0xE0 ? 1 : first < 0xF0 ? 2 : 3;
    int least = 0x80;
    int most = 0xBF;
    if (first == 0xE0) least = 0xA0;
    if (first == 0xED) most = 0x9F;
    if (first == 0xF0) least = 0x90;
    if (first == 0xF4) most = 0x8F;
    for (int i = 0; i < more; ++i, ++at_) {
      if (peek() < least || peek() > most) return false;
      least = 0x80;
      most = 0xBF;
    }
    return true;
  }

  const char* at_;
  const char* end_;
};

}  // namespace

bool is_strict_json_object(const char* text, std::size_t size) { return Checker(text, size).only_object(); }

}  // namespace foldcar
