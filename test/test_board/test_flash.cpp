// What the board keeps in its flash: parameters, logs, the car's design.
#include "../suite.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "../../firmware/lib/feather_hal/flash_design.h"
#include "feather_bench.h"
#include "log_writer.h"
#include "parameter_table.h"

using namespace foldcar;

static const std::uint8_t* bytes_of(const std::string& text) { return reinterpret_cast<const std::uint8_t*>(text.data()); }

// The same flash after a reset.
static void reset_board(std::unique_ptr<FeatherHal>& board) {
  fake_esp32.flash.is_mounted = false;
  board = std::make_unique<FeatherHal>();
  board->begin(115200);
}

static std::unique_ptr<FeatherHal> new_board() {
  fake_esp32 = {};
  auto board = std::make_unique<FeatherHal>();
  board->begin(115200);
  return board;
}

TEST(every_parameter_is_stored_over_a_reset) {
  auto board = new_board();
  float number = 0.5f;
  for (const ParameterInfo& info : parameter_table()) {
    number += 1.0f;
    TEST_ASSERT_TRUE_MESSAGE(board->storage.save(info.name, number), info.name);
  }
  reset_board(board);
  number = 0.5f;
  for (const ParameterInfo& info : parameter_table()) {
    float value = 0.0f;
    TEST_ASSERT_TRUE_MESSAGE(board->storage.load(info.name, value), info.name);
    number += 1.0f;
    TEST_ASSERT_EQUAL_FLOAT(number, value);
  }
}

TEST(a_value_that_does_not_fit_is_not_saved_and_the_old_one_stays) {
  auto board = new_board();
  TEST_ASSERT_TRUE(board->storage.save("TRACK_M", 0.2f));
  fake_esp32.flash.nvs_is_full = true;
  TEST_ASSERT_FALSE(board->storage.save("TRACK_M", 0.3f));
  float value = 0.0f;
  TEST_ASSERT_TRUE(board->storage.load("TRACK_M", value));
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value);
  TEST_ASSERT_FALSE_MESSAGE(board->storage.save("SIXTEEN_LETTERS_", 1.0f), "a name beyond the limit of 15");
  for (const std::size_t size : {2, 8}) {
    fake_esp32.flash.nvs["foldcar"]["TRACK_M"].assign(size, 1);
    TEST_ASSERT_FALSE_MESSAGE(board->storage.load("TRACK_M", value), "another program's bytes are no number");
  }
  TEST_ASSERT_EQUAL_FLOAT(0.2f, value);
}

static void prepare(FeatherHal& board) {
  while (board.logs.prepare()) {
  }
}

// Stores a log as the worker does, in flash that is ready for it. Returns its number.
static std::uint16_t store(FeatherHal& board, const std::string& content) {
  prepare(board);
  const std::uint16_t id = board.logs.create();
  TEST_ASSERT_TRUE(id > 0);
  TEST_ASSERT_TRUE(board.logs.append(bytes_of(content), content.size()));
  TEST_ASSERT_TRUE(board.logs.close());
  return id;
}

static std::string log_of(FeatherHal& board, std::uint16_t id) {
  std::string content(board.logs.size(id), '\0');
  TEST_ASSERT_EQUAL_UINT(content.size(), board.logs.read(id, 0, reinterpret_cast<std::uint8_t*>(content.data()), content.size()));
  return content;
}

static std::string random_bytes(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::string bytes;
  while (bytes.size() < size) bytes += static_cast<char>(random());
  return bytes;
}

// What is in it may be a design that someone can still save.
TEST(a_file_system_that_does_not_mount_is_not_formatted) {
  auto board = new_board();
  fake_esp32.flash.files["/car.json"] = "{}";
  fake_esp32.flash.is_formatted = fake_esp32.flash.is_mounted = false;
  TEST_ASSERT_TRUE(read_stored_design().source == DesignSource::kUnreadable);
  TEST_ASSERT_FALSE(fake_esp32.flash.is_formatted);
  TEST_ASSERT_EQUAL_UINT(1, fake_esp32.flash.files.count("/car.json"));
}

TEST(without_a_partition_for_them_no_log_is_promised) {
  for (const std::size_t size : {0u, 0x100000u}) {
    fake_esp32 = {};
    fake_esp32.flash.logs.resize(size);
    FeatherHal board;
    board.begin(115200);
    TEST_ASSERT_FALSE(board.logs.present());
    TEST_ASSERT_FALSE(board.logs.prepare());
    TEST_ASSERT_EQUAL_UINT16(0, board.logs.create());
  }
}

// Of every length around a page's, read as a whole and in parts, before and after a reset.
TEST(logs_come_back_byte_by_byte_and_are_found_again_after_a_reset) {
  auto board = new_board();
  for (const std::size_t size : {1u, 252u, 253u, 254u, 506u, 507u, 100000u, 250000u}) {
    const std::string content = random_bytes(size, static_cast<unsigned>(size));
    const std::uint16_t id = store(*board, content);
    TEST_ASSERT_TRUE(log_of(*board, id) == content);
    reset_board(board);
    TEST_ASSERT_TRUE(log_of(*board, id) == content);
    for (const std::size_t offset : {0u, 1u, 252u, 253u, 300u}) {
      std::uint8_t part[400];
      const std::size_t count = board->logs.read(id, offset, part, sizeof part);
      TEST_ASSERT_EQUAL_UINT(offset < size ? std::min<std::size_t>(sizeof part, size - offset) : 0, count);
      TEST_ASSERT_TRUE(content.compare(std::min(offset, size), count, reinterpret_cast<char*>(part), count) == 0);
    }
    TEST_ASSERT_TRUE(board->logs.remove(id));
  }
}

TEST(the_newest_four_logs_stay_over_a_reset) {
  auto board = new_board();
  for (int trial = 1; trial <= 11; ++trial) TEST_ASSERT_EQUAL_UINT16(trial, store(*board, "trial " + std::to_string(trial)));
  prepare(*board);
  reset_board(board);
  const LogRange logs = board->logs.range();
  TEST_ASSERT_EQUAL_UINT16(8, logs.oldest);
  TEST_ASSERT_EQUAL_UINT16(11, logs.newest);
  for (std::uint16_t id = logs.oldest; id <= logs.newest; ++id) TEST_ASSERT_TRUE(log_of(*board, id) == "trial " + std::to_string(id));
}

// Wheels may turn then, and an erased block would stop both cores for up to 0.4 s.
TEST(a_log_is_only_programmed_and_a_step_of_preparing_erases_one_block_at_most) {
  auto board = new_board();
  FakeFlash& flash = fake_esp32.flash;
  for (int more = 1; more;) {
    const int erased = flash.erased_count;
    more = board->logs.prepare();
    TEST_ASSERT_TRUE(flash.erased_count <= erased + 1);
  }
  TEST_ASSERT_EQUAL_INT(64, flash.erased_count);
  TEST_ASSERT_EQUAL_UINT16(1, board->logs.create());
  const std::string slice = random_bytes(240, 1);
  for (int i = 0; i < 1000; ++i) {
    const int programmed = flash.programmed_count;
    TEST_ASSERT_TRUE(board->logs.append(bytes_of(slice), slice.size()));
    TEST_ASSERT_TRUE(flash.programmed_count <= programmed + 1);
  }
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_EQUAL_INT(64, flash.erased_count);
  TEST_ASSERT_EQUAL_UINT(240000, board->logs.size(1));

  // A blank slot is not erased once more.
  prepare(*board);
  const int erased = flash.erased_count;
  reset_board(board);
  prepare(*board);
  TEST_ASSERT_EQUAL_INT(erased, flash.erased_count);
}

TEST(a_reset_costs_less_than_a_page_of_what_was_appended) {
  for (const bool tears_a_page : {false, true}) {
    auto board = new_board();
    prepare(*board);
    const std::string content = random_bytes(1000, 2);
    TEST_ASSERT_EQUAL_UINT16(1, board->logs.create());
    TEST_ASSERT_TRUE(board->logs.append(bytes_of(content), content.size()));
    // The supply fails while the third page is programmed: some of its bits are not cleared.
    const std::size_t pages = tears_a_page ? 2 : 3;
    if (tears_a_page) fake_esp32.flash.logs[3 * 256 + 200] = 0xFF;
    reset_board(board);
    TEST_ASSERT_TRUE(log_of(*board, 1) == content.substr(0, 253 * pages));
    TEST_ASSERT_EQUAL_UINT16(2, store(*board, "next"));
    TEST_ASSERT_TRUE(log_of(*board, 1) == content.substr(0, 253 * pages));
    TEST_ASSERT_TRUE(log_of(*board, 2) == "next");
  }
}

// A host may ask for a log in the moment between the trial's end and its close.
TEST(a_log_that_was_read_too_early_is_whole_when_it_is_read_again) {
  auto board = new_board();
  prepare(*board);
  TEST_ASSERT_EQUAL_UINT16(1, board->logs.create());
  TEST_ASSERT_TRUE(board->logs.append(bytes_of("early"), 5));
  TEST_ASSERT_TRUE(board->logs.size(1) <= 5);
  TEST_ASSERT_TRUE(board->logs.append(bytes_of(" late"), 5));
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_TRUE(log_of(*board, 1) == "early late");
}

// At the latest when it is closed, by its size.
TEST(flash_that_fails_is_told) {
  auto board = new_board();
  prepare(*board);
  const std::string part(240, 'x');
  TEST_ASSERT_EQUAL_UINT16(1, board->logs.create());
  for (int i = 0; i < 10; ++i) TEST_ASSERT_TRUE(board->logs.append(bytes_of(part), part.size()));
  fake_esp32.flash.write_fails = true;
  bool is_told = false;
  for (int i = 0; i < 2; ++i) is_told = is_told || !board->logs.append(bytes_of(part), part.size());
  TEST_ASSERT_TRUE(is_told);
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_EQUAL_UINT(9 * 253, board->logs.size(1));
  TEST_ASSERT_FALSE_MESSAGE(board->logs.prepare(), "it is not tried for ever");
  TEST_ASSERT_EQUAL_UINT16(0, board->logs.create());
}

// Its last page is programmed when it is closed.
TEST(flash_that_fails_only_at_close_leaves_the_log_incomplete) {
  auto board = new_board();
  LogWriter writer(board->logs);
  while (writer.work()) {
  }
  TEST_ASSERT_TRUE(writer.begin());
  const std::string record(300, 'x');
  TEST_ASSERT_TRUE(writer.put(bytes_of(record), record.size(), 0));
  writer.finish();
  const int programmed = fake_esp32.flash.programmed_count;
  for (int step = 0; step < 3; ++step) TEST_ASSERT_TRUE_MESSAGE(writer.work(), "it is opened, and all slices are taken");
  TEST_ASSERT_EQUAL_INT_MESSAGE(programmed + 1, fake_esp32.flash.programmed_count, "the second page waits for more");
  fake_esp32.flash.write_fails = true;
  while (writer.work()) {
  }
  TEST_ASSERT_TRUE(writer.status().state == LogState::kIncomplete);
  TEST_ASSERT_EQUAL_UINT32(300 - 253, writer.status().lost_bytes);
}

TEST(a_log_takes_what_it_has_room_for) {
  auto board = new_board();
  prepare(*board);
  TEST_ASSERT_EQUAL_UINT16(1, board->logs.create());
  const std::string part(253, 'x');
  std::size_t stored = 0;
  while (board->logs.append(bytes_of(part), part.size())) stored += part.size();
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_TRUE(stored >= kLogSize);
  TEST_ASSERT_EQUAL_UINT(stored, board->logs.size(1));
}

TEST(a_log_is_removed_but_not_while_it_is_written) {
  auto board = new_board();
  store(*board, "trial");
  prepare(*board);
  TEST_ASSERT_EQUAL_UINT16(2, board->logs.create());
  TEST_ASSERT_TRUE(board->logs.remove(1));
  TEST_ASSERT_FALSE(board->logs.remove(2));
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_TRUE(board->logs.remove(2));
  reset_board(board);
  TEST_ASSERT_TRUE(board->logs.range().is_empty());
  TEST_ASSERT_EQUAL_UINT16(0, board->logs.range().count());
}

// The supply fails most easily when the wheels start.
TEST(creating_a_log_writes_nothing_to_flash) {
  auto board = new_board();
  prepare(*board);
  const int programmed = fake_esp32.flash.programmed_count;
  TEST_ASSERT_EQUAL_UINT16(1, board->logs.create());
  TEST_ASSERT_EQUAL_INT(programmed, fake_esp32.flash.programmed_count);
}

// The first bytes of a slot: four that say it is a log, its number, a checksum.
constexpr std::size_t kSlotBytes = 64 * 4096, kNumberByte = 4, kHeaderBytes = 8;

// A reset while a slot is numbered leaves some bits of the header set: it is no log, and later numbers follow the last whole one.
TEST(a_torn_number_is_no_log_and_does_not_spoil_later_numbers) {
  for (std::size_t torn = 0; torn < kHeaderBytes; ++torn) {
    auto board = new_board();
    for (int trial = 0; trial < 2; ++trial) store(*board, "trial");
    std::vector<std::uint8_t>& flash = fake_esp32.flash.logs;
    for (std::size_t at = kSlotBytes + torn; at < kSlotBytes + kHeaderBytes; ++at) flash[at] = 0xFF;
    reset_board(board);
    TEST_ASSERT_EQUAL_UINT16(1, board->logs.range().newest);
    TEST_ASSERT_EQUAL_UINT16(2, store(*board, "again"));
    TEST_ASSERT_TRUE(log_of(*board, 2) == "again" && log_of(*board, 1) == "trial");
  }
}

TEST(a_slot_that_is_only_numbered_is_no_log) {
  auto board = new_board();
  store(*board, "trial");
  prepare(*board);
  TEST_ASSERT_EQUAL_UINT16(2, board->logs.create());
  reset_board(board);
  TEST_ASSERT_EQUAL_UINT16(1, board->logs.range().newest);
  TEST_ASSERT_EQUAL_UINT16(2, store(*board, "next"));
}

// CRC-16/CCITT-FALSE, bit by bit; its check value is that of the catalogue.
static std::uint16_t crc_of(const std::uint8_t* data, std::size_t size) {
  std::uint16_t crc = 0xFFFF;
  for (std::size_t i = 0; i < 8 * size; ++i) {
    const bool bit = ((data[i / 8] >> (7 - i % 8)) & 1) != (crc >> 15);
    crc = static_cast<std::uint16_t>((crc << 1) ^ (bit ? 0x1021 : 0));
  }
  return crc;
}

TEST(numbers_wrap_around_and_the_oldest_log_still_goes_first) {
  TEST_ASSERT_EQUAL_HEX16(0x29B1, crc_of(reinterpret_cast<const std::uint8_t*>("123456789"), 9));
  auto board = new_board();
  store(*board, "old");
  std::vector<std::uint8_t>& flash = fake_esp32.flash.logs;
  flash[kNumberByte] = 0xFE;
  flash[kNumberByte + 1] = 0xFF;
  const std::uint16_t crc = crc_of(flash.data(), kNumberByte + 2);
  flash[kNumberByte + 2] = static_cast<std::uint8_t>(crc & 0xFF);
  flash[kNumberByte + 3] = static_cast<std::uint8_t>(crc >> 8);
  reset_board(board);
  for (const int id : {65535, 1, 2}) TEST_ASSERT_EQUAL_UINT16(id, store(*board, "new"));
  TEST_ASSERT_EQUAL_UINT16(65534, board->logs.range().oldest);
  reset_board(board);
  TEST_ASSERT_EQUAL_UINT16(65534, board->logs.range().oldest);
  TEST_ASSERT_EQUAL_UINT16(2, board->logs.range().newest);
  // 65534, 65535, 1 and 2.
  TEST_ASSERT_EQUAL_UINT16(4, board->logs.range().count());
  TEST_ASSERT_EQUAL_UINT16(3, store(*board, "newest"));
  prepare(*board);
  TEST_ASSERT_EQUAL_UINT16(65535, board->logs.range().oldest);
}

#if __has_include(<ArduinoJson.h>)
TEST(the_stored_design_is_read_or_refused_with_its_reason) {
  auto board = new_board();
  TEST_ASSERT_TRUE(read_stored_design().source == DesignSource::kMissing);
  fake_esp32.flash.files["/car.json"] =
      R"({"format": 1, "name": "w95", "hash": "0123456789abcdef", "wheel_radius_m": 0.05, "track_m": 0.2,
          "wheels": [{"channel": 1, "side": "right", "direction": -1}, {"channel": 6, "side": "left", "direction": 1}]})";
  const DesignResult result = read_stored_design();
  TEST_ASSERT_EQUAL_STRING("", result.problem);
  TEST_ASSERT_EQUAL_STRING("w95", result.design.name);
  TEST_ASSERT_EQUAL_FLOAT(0.2f, result.design.track_m);
  fake_esp32.flash.read_fails = true;
  TEST_ASSERT_EQUAL_STRING("car.json: cannot be read", read_stored_design().problem);
  fake_esp32.flash.read_fails = false;
  fake_esp32.flash.files["/car.json"] = "[1]";
  TEST_ASSERT_EQUAL_STRING("car.json: is not a JSON object", read_stored_design().problem);
  fake_esp32.flash.files["/car.json"] = "";
  TEST_ASSERT_EQUAL_STRING("car.json: is not a JSON object", read_stored_design().problem);
  fake_esp32.flash.files["/car.json"] = std::string(8193, ' ');
  TEST_ASSERT_EQUAL_STRING("car.json: is larger than 8192 bytes", read_stored_design().problem);
}
#endif
