#include "flash_logs.h"

#include <algorithm>

namespace foldcar {
namespace {

constexpr const char* kPartition = "logs";
constexpr std::uint8_t kErased = 0xFF;
// The first bytes of a slot's first page, then the log's number, the lower byte first. A removed log's are zero.
constexpr std::array<std::uint8_t, 4> kHeader = {'L', 'O', 'G', '1'};
constexpr std::size_t kHeaderSize = kHeader.size() + 2;
// Blocks whose content is looked at in one step (1 ms each).
constexpr std::size_t kBlocksAtOnce = 8;

// CRC-16/CCITT-FALSE: https://reveng.sourceforge.io/crc-catalogue/16.htm
std::uint16_t checksum(const std::uint8_t* data, std::size_t size) {
  unsigned result = 0xFFFF;
  for (std::size_t i = 0; i < size; ++i) {
    result ^= static_cast<unsigned>(data[i]) << 8;
    for (int bit = 0; bit < 8; ++bit) result = (result << 1) ^ ((result & 0x8000) != 0 ? 0x1021 : 0);
  }
  return static_cast<std::uint16_t>(result);
}

}  // namespace

bool FlashLogs::begin() {
  partition_ = esp_partition_find_first(ESP_PARTITION_TYPE_DATA, ESP_PARTITION_SUBTYPE_ANY, kPartition);
  if (partition_ == nullptr || partition_->size < kSlots * kSlotSize) return partition_ = nullptr, false;
  for (std::size_t slot = 0; slot < kSlots; ++slot) {
    Page page;
    const bool has_log = read_page(slot, 0, page) && std::equal(kHeader.begin(), kHeader.end(), page.begin());
    ids_[slot] = has_log ? static_cast<std::uint16_t>(page[kHeader.size()] | page[kHeader.size() + 1] << 8) : 0;
  }
  return true;
}

bool FlashLogs::prepare() {
  if (!present() || open_ != kNone || prepared_ != kNone) return false;
  if (erasing_ == kNone) {
    const auto free = std::find(ids_.begin(), ids_.end(), 0);
    if (free == ids_.end()) return remove(*std::min_element(ids_.begin(), ids_.end()));
    erasing_ = static_cast<std::size_t>(free - ids_.begin());
    erased_blocks_ = 0;
  }
  for (std::size_t looks = 0; looks < kBlocksAtOnce && erased_blocks_ < kSlotSize / kBlock; ++looks, ++erased_blocks_) {
    if (block_is_blank(erasing_, erased_blocks_)) continue;
    const std::size_t at = erasing_ * kSlotSize + erased_blocks_ * kBlock;
    const bool is_erased = esp_partition_erase_range(partition_, at, kBlock) == ESP_OK;
    if (!is_erased) erasing_ = kNone;
    ++erased_blocks_;
    return is_erased;
  }
  if (erased_blocks_ < kSlotSize / kBlock) return true;
  prepared_ = erasing_;
  erasing_ = kNone;
  return false;
}

bool FlashLogs::create(std::uint16_t id) {
  if (!present() || id == 0 || prepared_ == kNone) return false;
  remove(id);
  std::array<std::uint8_t, kHeaderSize> header{};
  std::copy(kHeader.begin(), kHeader.end(), header.begin());
  header[kHeader.size()] = static_cast<std::uint8_t>(id & 0xFF);
  header[kHeader.size() + 1] = static_cast<std::uint8_t>(id >> 8);
  open_ = prepared_;
  prepared_ = kNone;
  page_number_ = 1;
  page_bytes_ = 0;
  const bool is_created = esp_partition_write(partition_, open_ * kSlotSize, header.data(), header.size()) == ESP_OK;
  if (is_created) {
    ids_[open_] = id;
  } else {
    open_ = kNone;
  }
  return is_created;
}

bool FlashLogs::append(const std::uint8_t* data, std::size_t size) {
  if (open_ == kNone) return false;
  for (std::size_t i = 0; i < size; ++i) {
    if (page_number_ == kSlotSize / kPage) return false;
    page_[1 + page_bytes_++] = data[i];
    if (page_bytes_ == kContent && !program_page()) return false;
  }
  return true;
}

bool FlashLogs::close() {
  if (open_ == kNone) return false;
  if (page_bytes_ > 0) program_page();
  open_ = kNone;
  measured_id_ = 0;
  return true;
}

// All pages but the last are full. A page that was being programmed at a reset is not whole: the log ends before it.
std::size_t FlashLogs::size(std::uint16_t id) {
  if (id != 0 && id == measured_id_) return measured_size_;
  const std::size_t slot = slot_of(id);
  if (slot == kNone) return 0;
  std::size_t size = 0;
  Page page;
  for (std::size_t last = programmed_pages(slot); last > 0 && size == 0; --last) {
    if (read_page(slot, last, page) && is_whole(page)) size = (last - 1) * kContent + page[0];
  }
  if (slot == open_) return size;
  measured_id_ = id;
  return measured_size_ = size;
}

std::size_t FlashLogs::read(std::uint16_t id, std::size_t offset, std::uint8_t* data, std::size_t size) {
  const std::size_t slot = slot_of(id), end = std::min(this->size(id), offset + size);
  std::size_t count = 0;
  Page page;
  while (offset + count < end) {
    const std::size_t at = offset + count, first = at % kContent;
    if (!read_page(slot, 1 + at / kContent, page)) return count;
    const std::size_t part = std::min(end - at, kContent - first);
    std::copy_n(page.begin() + 1 + static_cast<std::ptrdiff_t>(first), part, data + count);
    count += part;
  }
  return count;
}

bool FlashLogs::remove(std::uint16_t id) {
  const std::size_t slot = slot_of(id);
  if (slot == kNone || slot == open_) return false;
  constexpr std::array<std::uint8_t, kHeaderSize> kRemoved{};
  ids_[slot] = 0;
  measured_id_ = 0;
  return esp_partition_write(partition_, slot * kSlotSize, kRemoved.data(), kRemoved.size()) == ESP_OK;
}

bool FlashLogs::range(std::uint16_t& first, std::uint16_t& last) {
  if (!present()) return false;
  std::uint16_t smallest = 0, largest = 0;
  for (const std::uint16_t id : ids_) {
    if (id != 0 && (smallest == 0 || id < smallest)) smallest = id;
    largest = std::max(largest, id);
  }
  if (largest == 0) return false;
  first = smallest;
  last = largest;
  return true;
}

std::size_t FlashLogs::slot_of(std::uint16_t id) const {
  if (id == 0 || !present()) return kNone;
  return static_cast<std::size_t>(std::find(ids_.begin(), ids_.end(), id) - ids_.begin());
}

bool FlashLogs::read_page(std::size_t slot, std::size_t page, Page& content) const {
  return esp_partition_read(partition_, slot * kSlotSize + page * kPage, content.data(), kPage) == ESP_OK;
}

bool FlashLogs::program_page() {
  page_[0] = static_cast<std::uint8_t>(page_bytes_);
  std::fill(page_.begin() + 1 + static_cast<std::ptrdiff_t>(page_bytes_), page_.end(), kErased);
  const std::uint16_t sum = checksum(page_.data(), 1 + kContent);
  page_[kPage - 2] = static_cast<std::uint8_t>(sum >> 8);
  page_[kPage - 1] = static_cast<std::uint8_t>(sum & 0xFF);
  const std::size_t at = open_ * kSlotSize + page_number_ * kPage;
  page_bytes_ = 0;
  ++page_number_;
  return esp_partition_write(partition_, at, page_.data(), kPage) == ESP_OK;
}

// The number of the last page of a log: pages are programmed in their order.
std::size_t FlashLogs::programmed_pages(std::size_t slot) const {
  std::size_t low = 0, high = kSlotSize / kPage;
  Page page;
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    const bool is_programmed = read_page(slot, middle, page) && page[0] != kErased;
    (is_programmed ? low : high) = middle;
  }
  return low;
}

bool FlashLogs::is_whole(const Page& page) {
  const std::uint16_t sum = checksum(page.data(), 1 + kContent);
  return page[0] > 0 && page[0] <= kContent && page[kPage - 2] == sum >> 8 && page[kPage - 1] == (sum & 0xFF);
}

bool FlashLogs::block_is_blank(std::size_t slot, std::size_t block) const {
  Page page;
  for (std::size_t number = 0; number < kBlock / kPage; ++number) {
    if (!read_page(slot, block * kBlock / kPage + number, page)) return false;
    if (std::any_of(page.begin(), page.end(), [](std::uint8_t byte) { return byte != kErased; })) return false;
  }
  return true;
}

}  // namespace foldcar
