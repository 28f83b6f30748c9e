// What the board keeps in its flash: parameters, logs, the car's design.
#include "../suite.h"

#include <cstring>
#include <memory>
#include <string>

#include "../../firmware/lib/feather_hal/flash_design.h"
#include "feather_bench.h"
#include "parameter_table.h"

using namespace foldcar;

static const std::uint8_t* bytes_of(const std::string& text) { return reinterpret_cast<const std::uint8_t*>(text.data()); }

// The same flash after a reset; handles that were open are gone, with what they had not committed.
static void reset_board(std::unique_ptr<FeatherHal>& board) {
  fake_esp32.flash.is_mounted = false;
  board = std::make_unique<FeatherHal>();
  fake_esp32.flash.open_count.clear();
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

// What is in it may be a design that someone can still save.
TEST(a_file_system_that_does_not_mount_is_not_formatted) {
  auto board = new_board();
  fake_esp32.flash.files["/car.json"] = "{}";
  fake_esp32.flash.is_formatted = false;
  reset_board(board);
  TEST_ASSERT_FALSE(board->logs.present());
  TEST_ASSERT_FALSE(fake_esp32.flash.is_formatted);
  TEST_ASSERT_EQUAL_UINT(1, fake_esp32.flash.files.count("/car.json"));
}

TEST(logs_are_found_again_after_a_reset_and_other_files_are_none) {
  auto board = new_board();
  fake_esp32.flash.files["/car.json"] = "{}";
  fake_esp32.flash.files["/log_x"] = "no number";
  for (const std::uint16_t id : {9, 10}) {
    TEST_ASSERT_TRUE(board->logs.create(id));
    TEST_ASSERT_TRUE(board->logs.append(bytes_of("trial"), 5));
    TEST_ASSERT_TRUE(board->logs.close());
  }
  reset_board(board);
  std::uint16_t first = 0, last = 0;
  TEST_ASSERT_TRUE(board->logs.range(first, last));
  TEST_ASSERT_EQUAL_UINT16(9, first);
  TEST_ASSERT_EQUAL_UINT16(10, last);
  TEST_ASSERT_EQUAL_UINT(5, board->logs.size(10));
}

TEST(a_brown_out_costs_less_than_32_KiB_of_what_was_appended) {
  auto board = new_board();
  const std::string part(1024, 'x');
  TEST_ASSERT_TRUE(board->logs.create(1));
  for (int i = 0; i < 63; ++i) TEST_ASSERT_TRUE(board->logs.append(bytes_of(part), part.size()));
  reset_board(board);
  TEST_ASSERT_EQUAL_UINT(32 * 1024, board->logs.size(1));
}

// A host may ask for a log in the moment between the trial's end and its close.
TEST(a_log_that_was_read_too_early_is_whole_when_it_is_read_again) {
  auto board = new_board();
  TEST_ASSERT_TRUE(board->logs.create(1));
  TEST_ASSERT_TRUE(board->logs.append(bytes_of("early"), 5));
  TEST_ASSERT_TRUE(board->logs.size(1) <= 5);
  TEST_ASSERT_TRUE(board->logs.append(bytes_of(" late"), 5));
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_EQUAL_UINT(10, board->logs.size(1));
  std::uint8_t bytes[16];
  TEST_ASSERT_EQUAL_UINT(10, board->logs.read(1, 0, bytes, sizeof bytes));
  TEST_ASSERT_EQUAL_MEMORY("early late", bytes, 10);
}

// At the latest when it is closed, by its size.
TEST(an_append_to_a_file_system_that_fails_is_told) {
  auto board = new_board();
  const std::string part(16 * 1024, 'x');
  TEST_ASSERT_TRUE(board->logs.create(1));
  for (int i = 0; i < 2; ++i) TEST_ASSERT_TRUE(board->logs.append(bytes_of(part), part.size()));
  fake_esp32.flash.write_fails = true;
  TEST_ASSERT_TRUE(board->logs.append(bytes_of(part), part.size()));
  TEST_ASSERT_FALSE(board->logs.append(bytes_of(part), part.size()));
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_EQUAL_UINT(2 * part.size(), board->logs.size(1));
}

// Without a free block LittleFS divides by zero: whatever fills the file system, logs leave some.
TEST(a_full_file_system_takes_no_log_and_a_log_does_not_fill_it) {
  for (const std::size_t others : {0u, 1000000u, 1300000u, 1390000u, 1400000u, 1430000u}) {
    auto board = new_board();
    fake_esp32.flash.files["/car.json"] = std::string(others, 'x');
    const std::string part(4096, 'x');
    const bool is_created = board->logs.create(1);
    TEST_ASSERT_TRUE(is_created == (others <= 1400000u));
    std::size_t stored = 0;
    while (board->logs.append(bytes_of(part), part.size())) stored += part.size();
    TEST_ASSERT_TRUE(is_created == board->logs.close());
    TEST_ASSERT_FALSE_MESSAGE(fake_esp32.flash.divided_by_zero, "the board has crashed");
    TEST_ASSERT_EQUAL_UINT(stored, board->logs.size(1));
    TEST_ASSERT_TRUE(others + stored + 48 * 1024 > (is_created ? 1441792u : 0u));
  }
}

// LittleFS refuses to remove a file that is open, the one that is being read included.
TEST(a_log_is_removed_while_it_is_read_but_not_while_it_is_written) {
  auto board = new_board();
  for (const std::uint16_t id : {1, 2}) {
    TEST_ASSERT_TRUE(board->logs.create(id));
    TEST_ASSERT_TRUE(board->logs.append(bytes_of("trial"), 5));
    if (id == 1) TEST_ASSERT_TRUE(board->logs.close());
  }
  TEST_ASSERT_EQUAL_UINT(5, board->logs.size(1));
  TEST_ASSERT_TRUE(board->logs.remove(1));
  TEST_ASSERT_FALSE(board->logs.remove(2));
  TEST_ASSERT_TRUE(board->logs.close());
  TEST_ASSERT_TRUE(board->logs.remove(2));
}

#if __has_include(<ArduinoJson.h>)
TEST(the_stored_design_is_read_or_refused_with_its_reason) {
  auto board = new_board();
  TEST_ASSERT_TRUE(read_stored_design(true).source == DesignSource::kMissing);
  TEST_ASSERT_TRUE(read_stored_design(false).source == DesignSource::kUnreadable);
  fake_esp32.flash.files["/car.json"] =
      R"({"format": 1, "name": "w95", "hash": "0123456789abcdef", "wheel_radius_m": 0.05, "track_m": 0.2,
          "wheels": [{"channel": 1, "side": "right", "direction": -1}, {"channel": 6, "side": "left", "direction": 1}]})";
  const DesignResult result = read_stored_design(true);
  TEST_ASSERT_EQUAL_STRING("", result.problem);
  TEST_ASSERT_EQUAL_STRING("w95", result.design.name);
  TEST_ASSERT_EQUAL_FLOAT(0.2f, result.design.track_m);
  fake_esp32.flash.read_fails = true;
  TEST_ASSERT_EQUAL_STRING("car.json: cannot be read", read_stored_design(true).problem);
  fake_esp32.flash.read_fails = false;
  fake_esp32.flash.files["/car.json"] = "[1]";
  TEST_ASSERT_EQUAL_STRING("car.json: is not a JSON object", read_stored_design(true).problem);
  fake_esp32.flash.files["/car.json"] = "";
  TEST_ASSERT_EQUAL_STRING("car.json: is not a JSON object", read_stored_design(true).problem);
  fake_esp32.flash.files["/car.json"] = std::string(8193, ' ');
  TEST_ASSERT_EQUAL_STRING("car.json: is larger than 8192 bytes", read_stored_design(true).problem);
}
#endif
