// One partition, in memory. A test sets what its table says, and what an operation takes.
#pragma once

#include <stddef.h>
#include <string.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "esp_err.h"

constexpr esp_err_t ESP_ERR_INVALID_SIZE = 0x104;

enum esp_partition_type_t { ESP_PARTITION_TYPE_APP = 0, ESP_PARTITION_TYPE_DATA = 1 };
enum esp_partition_subtype_t { ESP_PARTITION_SUBTYPE_ANY = 0xff };

struct esp_partition_t {
  uint32_t size;
  uint32_t erase_size;
  bool readonly;
};

struct FakePartition {
  std::string label;  ///< Of a data partition; empty: the table has none.
  esp_partition_t entry{};
  esp_err_t result = ESP_OK;                 ///< Of each operation.
  std::function<void(bool erases)> on_call;  ///< Called while one is under way.
  std::vector<uint8_t> bytes;
  int erasures = 0;
};
inline FakePartition fake_partition;
/// One that is erased, with sectors as the chip's flash has them.
inline FakePartition blank_partition(const char* label, uint32_t size) {
  return {.label = label,
          .entry = {.size = size, .erase_size = 4096, .readonly = false},
          .on_call = {},
          .bytes = std::vector<uint8_t>(size, 0xff)};
}

inline const esp_partition_t* esp_partition_find_first(esp_partition_type_t type,
                                                       esp_partition_subtype_t, const char* label) {
  const bool is_it = type == ESP_PARTITION_TYPE_DATA && fake_partition.label == label;
  return is_it ? &fake_partition.entry : nullptr;
}

inline esp_err_t fake_call(const esp_partition_t* partition, size_t end, bool erases) {
  if (fake_partition.on_call) fake_partition.on_call(erases);
  return end > partition->size ? ESP_ERR_INVALID_SIZE : fake_partition.result;
}

inline esp_err_t esp_partition_read(const esp_partition_t* partition, size_t offset, void* out,
                                    size_t size) {
  const esp_err_t result = fake_call(partition, offset + size, false);
  if (result == ESP_OK) memcpy(out, fake_partition.bytes.data() + offset, size);
  return result;
}

inline esp_err_t esp_partition_write(const esp_partition_t* partition, size_t offset,
                                     const void* data, size_t size) {
  const esp_err_t result = fake_call(partition, offset + size, false);
  const auto* const bytes = static_cast<const uint8_t*>(data);
  for (size_t i = 0; result == ESP_OK && i < size; ++i)
    fake_partition.bytes[offset + i] &= bytes[i];
  return result;
}

inline esp_err_t esp_partition_erase_range(const esp_partition_t* partition, size_t offset,
                                           size_t size) {
  const esp_err_t result = fake_call(partition, offset + size, true);
  if (result != ESP_OK) return result;
  ++fake_partition.erasures;
  std::fill_n(fake_partition.bytes.begin() + static_cast<ptrdiff_t>(offset), size, uint8_t{0xff});
  return ESP_OK;
}
