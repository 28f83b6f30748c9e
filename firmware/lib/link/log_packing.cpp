#include "log_packing.h"

#include <algorithm>

namespace foldcar {
namespace {

constexpr std::uint8_t kOwnFlag = 0x80;
constexpr std::uint8_t kMoreFlag = 0x80;
constexpr std::size_t kStampSize = 8;  // bytes of the time before each packet
static_assert(kStampSize + MAVLINK_NUM_NON_PAYLOAD_BYTES + kLargestContent <= kLargestRecord, "a record has room");
static_assert(1 + 10 + (kLargestContent + 7) / 8 + kLargestContent <= kLargestPacked, "and a packed one");
static_assert(MAVLINK_MSG_ID_FOLDCAR_TRIAL_LEN <= kLargestContent && MAVLINK_MSG_ID_SYS_STATUS_LEN <= kLargestContent &&
                  MAVLINK_MSG_ID_SERVO_OUTPUT_RAW_LEN <= kLargestContent &&
                  MAVLINK_MSG_ID_BATTERY_STATUS_LEN <= kLargestContent &&
                  MAVLINK_MSG_ID_ATTITUDE_LEN <= kLargestContent && MAVLINK_MSG_ID_SCALED_IMU_LEN <= kLargestContent,
              "it is the longest");

std::size_t kind_of(const mavlink_message_t& message) {
  return static_cast<std::size_t>(std::find(kLogged.begin(), kLogged.end(), message.msgid) - kLogged.begin());
}

// The content's size before MAVLink leaves out zeros at its end.
std::size_t content_size(std::uint32_t message_id) { return mavlink_get_msg_entry(message_id)->max_msg_len; }

// The i-th byte of the content; 0 for those at the end that MAVLink leaves out, where the message holds its checksum.
std::uint8_t content_byte(const mavlink_message_t& message, std::size_t i) {
  return i < message.len ? static_cast<std::uint8_t>(_MAV_PAYLOAD(&message)[i]) : std::uint8_t{0};
}

}  // namespace

// Packs a message by its differences to the last one of its kind: a byte with kind and component, the time since the
// last record (µs, 7 bits a byte, lowest first), a bit for each byte of the content that differs, then these bytes.
// Returns the packed size.
std::size_t LogPacker::pack(std::uint64_t time_us, const mavlink_message_t& message,
                            std::uint8_t (&packed)[kLargestPacked]) const {
  const std::size_t kind = kind_of(message);
  std::size_t at = 0;
  packed[at++] = static_cast<std::uint8_t>(kind | (message.compid == kOwnComponent ? kOwnFlag : 0));
  std::uint64_t passed_us = time_us - last_.time_us;
  for (; passed_us >= kMoreFlag; passed_us >>= 7) packed[at++] = static_cast<std::uint8_t>(passed_us | kMoreFlag);
  packed[at++] = static_cast<std::uint8_t>(passed_us);

  const std::size_t size = content_size(message.msgid);
  std::uint8_t* const differs = packed + at;
  at += (size + 7) / 8;
  std::fill(differs, packed + at, std::uint8_t{0});
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint8_t byte = content_byte(message, i);
    if (byte == last_.contents[kind][i]) continue;
    differs[i / 8] = static_cast<std::uint8_t>(differs[i / 8] | (1u << (i % 8)));
    packed[at++] = byte;
  }
  return at;
}

void LogPacker::keep(std::uint64_t time_us, const mavlink_message_t& message) {
  last_.time_us = time_us;
  auto& content = last_.contents[kind_of(message)];
  for (std::size_t i = 0; i < content_size(message.msgid); ++i) content[i] = content_byte(message, i);
}

void LogUnpacker::begin() {
  last_ = {};
  numbers_ = {};
}

// Restores one record that LogPacker::pack has packed: the time (µs, 8 bytes, highest first) and the MAVLink packet.
// Returns the sizes of both forms.
LogFormat::Unpacked LogUnpacker::unpack(const std::uint8_t* packed, std::uint8_t* record) {
  const std::uint8_t* from = packed;
  const bool is_own = (*from & kOwnFlag) != 0;
  const std::size_t kind = *from++ & ~kOwnFlag;
  std::uint64_t passed_us = 0;
  int shift = 0;
  for (; (*from & kMoreFlag) != 0; shift += 7) passed_us |= static_cast<std::uint64_t>(*from++ & ~kMoreFlag) << shift;
  last_.time_us += passed_us | static_cast<std::uint64_t>(*from++) << shift;

  auto& content = last_.contents[kind];
  const mavlink_msg_entry_t& entry = *mavlink_get_msg_entry(kLogged[kind]);
  const std::uint8_t* const differs = from;
  from += (entry.max_msg_len + 7) / 8;
  for (std::size_t i = 0; i < entry.max_msg_len; ++i) {
    if ((differs[i / 8] & (1u << (i % 8))) != 0) content[i] = *from++;
  }

  mavlink_message_t message{};
  message.msgid = kLogged[kind];
  std::copy_n(content.begin(), entry.max_msg_len, reinterpret_cast<std::uint8_t*>(_MAV_PAYLOAD_NON_CONST(&message)));
  mavlink_finalize_message_buffer(&message, kCarSystem, is_own ? kOwnComponent : kCarComponent,
                                  is_own ? &numbers_.own : &numbers_.car, entry.min_msg_len, entry.max_msg_len,
                                  entry.crc_extra);
  for (std::size_t i = 0; i < kStampSize; ++i) {
    record[i] = static_cast<std::uint8_t>(last_.time_us >> (8 * (kStampSize - 1 - i)));
  }
  const std::size_t size = kStampSize + mavlink_msg_to_send_buffer(record + kStampSize, &message);
  return {static_cast<std::size_t>(from - packed), size};
}

}  // namespace foldcar
