// Fake of ESP-IDF 4.4: partitions of flash. Programming clears bits, erasing sets those of whole blocks.
#pragma once

#include <cstring>

#include "fake_esp32.h"

enum esp_partition_type_t { ESP_PARTITION_TYPE_DATA = 1 };
enum esp_partition_subtype_t { ESP_PARTITION_SUBTYPE_ANY = 0xFF };

struct esp_partition_t {
  std::uint32_t size = 0;  // bytes
};

inline const esp_partition_t* esp_partition_find_first(esp_partition_type_t, esp_partition_subtype_t, const char* label) {
  static esp_partition_t logs;
  logs.size = static_cast<std::uint32_t>(fake_esp32.flash.logs.size());
  return logs.size > 0 && std::strcmp(label, "logs") == 0 ? &logs : nullptr;
}

inline bool is_in_fake_logs(std::size_t at, std::size_t size) { return at + size <= fake_esp32.flash.logs.size(); }

inline esp_err_t esp_partition_read(const esp_partition_t*, std::size_t at, void* into, std::size_t size) {
  if (!is_in_fake_logs(at, size)) return -1;
  std::memcpy(into, fake_esp32.flash.logs.data() + at, size);
  return ESP_OK;
}

inline esp_err_t esp_partition_write(const esp_partition_t*, std::size_t at, const void* from, std::size_t size) {
  FakeFlash& flash = fake_esp32.flash;
  if (!is_in_fake_logs(at, size) || flash.write_fails) return -1;
  for (std::size_t i = 0; i < size; ++i) flash.logs[at + i] &= static_cast<const std::uint8_t*>(from)[i];
  ++flash.programmed_count;
  return ESP_OK;
}

inline esp_err_t esp_partition_erase_range(const esp_partition_t*, std::size_t at, std::size_t size) {
  constexpr std::size_t kBlock = 4096;
  FakeFlash& flash = fake_esp32.flash;
  if (!is_in_fake_logs(at, size) || at % kBlock != 0 || size % kBlock != 0 || flash.write_fails) return -1;
  std::memset(flash.logs.data() + at, 0xFF, size);
  flash.erased_count += static_cast<int>(size / kBlock);
  return ESP_OK;
}
