// Named tensors in a file: 8-byte little-endian length of a JSON header, the header, the raw little-endian values.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/tensor.h"

namespace vsplat {

enum class Dtype : std::uint8_t { f64, f32, f16, bf16, i64, i32, i16, i8, u64, u32, u16, u8, boolean };
std::size_t size_of(Dtype dtype);
const char* name_of(Dtype dtype);  // "F32", as in the header

struct TensorEntry {
  std::string name;
  Dtype dtype = Dtype::f32;
  Shape shape;
  std::uint64_t offset = 0, bytes = 0;  // in the file

  long count() const;
};

std::string text_of(const Shape& shape);  // "[4, 1025, 768]"

// Result of comparing a file with the digest that it states.
enum class HashState { absent, matches, differs };

// A safetensors file, open or in memory, with its header fully checked: every tensor lies inside the file, tensors
// neither overlap nor leave gaps, and sizes equal shape x dtype. Values are read on request, so no second copy of them
// is ever held.
class SafetensorsFile {
 public:
  explicit SafetensorsFile(const std::string& path);
  // Reads a file's bytes in memory, which must outlive this object; errors name it `name`.
  SafetensorsFile(const std::string& name, std::span<const std::byte> content);
  ~SafetensorsFile();
  SafetensorsFile(SafetensorsFile&&) noexcept;

  const std::string& path() const { return path_; }
  std::uint64_t bytes() const;  // of the whole file
  const std::map<std::string, std::string>& metadata() const { return metadata_; }
  const std::vector<TensorEntry>& tensors() const { return tensors_; }  // in the order of their values
  const TensorEntry* find(const std::string& name) const;               // null if there is none
  const TensorEntry& at(const std::string& name) const;                 // Error(format) naming it if missing

  // Converts any dtype to float: F16 and BF16 exactly, wider ones rounded to nearest.
  std::vector<float> floats(const TensorEntry& entry) const;
  // Integers and booleans only.
  std::vector<std::int64_t> integers(const TensorEntry& entry) const;

  // Compares the metadata's `sha256` with the digest of the whole file, in which those 64 digits count as '0'. Reads
  // the whole file.
  HashState check_hash() const;

 private:
  class Source;
  void read_header();
  std::vector<std::byte> raw(const TensorEntry& entry) const;

  std::string path_;
  std::unique_ptr<Source> source_;
  std::string header_;
  std::map<std::string, std::string> metadata_;
  std::vector<TensorEntry> tensors_;
  std::map<std::string, std::size_t> index_;
};

struct TensorToWrite {
  std::string name;
  Dtype dtype = Dtype::f32;
  Shape shape;
  const void* data = nullptr;  // shape x dtype bytes, row-major, the host's (little-endian) values
};

// Writes the tensors in the order given, under a temporary name that is renamed at the end. The same tensors and
// metadata give the same bytes. With `hash`, the metadata's `sha256` is set, see check_hash().
void write_safetensors(const std::string& path, const std::vector<TensorToWrite>& tensors,
                       const std::map<std::string, std::string>& metadata = {}, bool hash = false);

}  // namespace vsplat
