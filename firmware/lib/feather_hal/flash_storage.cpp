#include "flash_storage.h"

namespace foldcar {

bool FlashStorage::begin() { return open_ = preferences_.begin("foldcar", false); }

bool FlashStorage::load(const char* name, float& value) {
  float stored = 0.0f;
  // getBytes alone would log an error on the serial port for each parameter that was never saved.
  if (!preferences_.isKey(name)) return false;
  if (preferences_.getBytes(name, &stored, sizeof stored) != sizeof stored) return false;
  value = stored;
  return true;
}

bool FlashStorage::save(const char* name, float value) {
  return preferences_.putBytes(name, &value, sizeof value) == sizeof value;
}

bool FlashStorage::clear() { return preferences_.clear(); }

}  // namespace foldcar
