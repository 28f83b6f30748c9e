#include "flash_logs.h"

#include <algorithm>

namespace foldcar {
namespace {

constexpr const char* kPartition = "logs";
constexpr std::uint8_t kErased = 0xFF;
// The first bytes of a slot's first page, then the log's number and a checksum of all these, the lower byte first. A removed
// log's are zero.
constexpr std::array<std::uint8_t, 4> kMagic = {'L', 'O', 'G', '2'};
constexpr std::size_t kNumberAt = kMagic.size(), kChecksumAt = kNumberAt + 2, kHeaderSize = kChecksumAt + 2;
using Header = std::array<std::uint8_t, kHeaderSize>;
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

void put_number(Header& header, std::size_t at, std::uint16_t number) {
  header[at] = static_cast<std::uint8_t>(number & 0xFF);
  header[at + 1] = static_cast<std::uint8_t>(number >> 8);
}

Header header_of(std::uint16_t id) {
  Header header{};
  std::copy(kMagic.begin(), kMagic.end(), header.begin());
  put_number(header, kNumberAt, id);
  put_number(header, kChecksumAt, checksum(header.data(), kChecksumAt));
  return header;
}

}  // namespace

bool FlashLogs::begin() {
  partition_ = esp_partition_find_first(ESP_PARTITION_TYPE_DATA, ESP_PARTITION_SUBTYPE_ANY, kPartition);
  if (partition_ == nullptr || partition_->size < kSlots * kSlotSize) return partition_ = nullptr, false;
  for (std::size_t slot = 0; slot < kSlots; ++slot) ids_[slot] = programmed_pages(slot) > 0 ? read_number(slot) : 0;
  return true;
}

// The number of the log that a slot's first page names; 0 if it names none.
std::uint16_t FlashLogs::read_number(std::size_t slot) const {
  Page page;
  if (!read_page(slot, 0, page)) return 0;
  const auto id = static_cast<std::uint16_t>(page[kNumberAt] | page[kNumberAt + 1] << 8);
  const Header header = header_of(id);
  return std::equal(header.begin(), header.end(), page.begin()) ? id : std::uint16_t{0};
}

bool FlashLogs::program_number(std::size_t slot, std::uint16_t id) {
  const Header header = header_of(id);
  return esp_partition_write(partition_, slot * kSlotSize, header.data(), header.size()) == ESP_OK;
}

bool FlashLogs::prepare() {
  if (!present() || open_ != kNone || prepared_ != kNone) return false;
  if (erasing_ == kNone) {
    const auto free = std::find(ids_.begin(), ids_.end(), 0);
    if (free == ids_.end()) return remove(range().oldest);
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
  const std::size_t slot = erasing_;
  erasing_ = kNone;
  const std::uint16_t id = next_log_number(range().newest);
  if (!program_number(slot, id)) return false;
  prepared_ = slot;
  prepared_id_ = id;
  return false;
}

std::uint16_t FlashLogs::create() {
  if (!present() || prepared_ == kNone) return 0;
  open_ = prepared_;
  ids_[open_] = prepared_id_;
  prepared_ = kNone;
  page_number_ = 1;
  page_bytes_ = 0;
  return prepared_id_;
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
  constexpr Header kRemoved{};
  ids_[slot] = 0;
  measured_id_ = 0;
  return esp_partition_write(partition_, slot * kSlotSize, kRemoved.data(), kRemoved.size()) == ESP_OK;
}

LogRange FlashLogs::range() const {
  LogRange result;
  if (!present()) return result;
  for (const std::uint16_t id : ids_) result.add(id);
  return result;
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
    // A slot that was prepared before a reset has its number already. To program the same bytes again changes nothing.
    const bool is_numbered = block == 0 && number == 0 && read_number(slot) == next_log_number(range().newest);
    const auto is_programmed = [](std::uint8_t byte) { return byte != kErased; };
    if (std::any_of(page.begin() + (is_numbered ? kHeaderSize : 0), page.end(), is_programmed)) return false;
  }
  return true;
}

}  // namespace foldcar
