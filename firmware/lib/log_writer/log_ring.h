// A ring of bytes between two tasks: one puts records in, the other takes bytes out. Neither ever waits for the other.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace foldcar {

class LogRing {
 public:
  static constexpr std::size_t kSize = 72 * 1024;  // bytes; what the board's static memory has room for

  // For the task that puts: adds a whole record if reserve bytes stay free behind it, else returns false.
  bool put(const std::uint8_t* data, std::size_t size, std::size_t reserve) {
    const std::uint32_t put = put_.load(std::memory_order_relaxed);
    const std::size_t used = put - taken_.load(std::memory_order_acquire);
    if (size + reserve > kSize - used) return false;
    for (std::size_t i = 0; i < size; ++i) bytes_[(put + i) % kSize] = data[i];
    put_.store(put + static_cast<std::uint32_t>(size), std::memory_order_release);
    return true;
  }

  // For the task that takes: how many bytes wait; copies up to size of them and returns their number; and that size bytes
  // are done with.
  std::size_t waiting() const {
    return put_.load(std::memory_order_acquire) - taken_.load(std::memory_order_relaxed);
  }
  std::size_t copy(std::uint8_t* into, std::size_t size) const {
    const std::size_t at = taken_.load(std::memory_order_relaxed);
    size = std::min(size, waiting());
    for (std::size_t i = 0; i < size; ++i) into[i] = bytes_[(at + i) % kSize];
    return size;
  }
  void take(std::size_t size) {
    taken_.store(taken_.load(std::memory_order_relaxed) + static_cast<std::uint32_t>(size), std::memory_order_release);
  }

  // Empties the ring, so that its first byte is the next one. Only while no other task uses it.
  void clear() {
    put_.store(0, std::memory_order_relaxed);
    taken_.store(0, std::memory_order_relaxed);
  }

 private:
  std::array<std::uint8_t, kSize> bytes_;  // what is in it is set when it is put
  std::atomic<std::uint32_t> put_{0}, taken_{0};  // bytes since clear(), fewer than 2^32
};

}  // namespace foldcar
