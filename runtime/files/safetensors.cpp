#include "runtime/files/safetensors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "runtime/fail.h"
#include "runtime/files/output_file.h"
#include "runtime/files/sha256.h"
#include "runtime/half.h"
#include "runtime/host_span.h"
#include "runtime/json_text.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace vsplat {

static_assert(std::endian::native == std::endian::little,
              "values are copied to and from little-endian files as they are");

namespace {

using nlohmann::json;

constexpr std::uint64_t kMaxHeader = 100'000'000;
constexpr std::size_t kDigits = 64;

struct DtypeInfo {
  Dtype dtype;
  const char* name;
  std::size_t size;
};
constexpr DtypeInfo kDtypes[] = {{Dtype::f64, "F64", 8},     {Dtype::f32, "F32", 4}, {Dtype::f16, "F16", 2},
                                 {Dtype::bf16, "BF16", 2},   {Dtype::i64, "I64", 8}, {Dtype::i32, "I32", 4},
                                 {Dtype::i16, "I16", 2},     {Dtype::i8, "I8", 1},   {Dtype::u64, "U64", 8},
                                 {Dtype::u32, "U32", 4},     {Dtype::u16, "U16", 2}, {Dtype::u8, "U8", 1},
                                 {Dtype::boolean, "BOOL", 1}};

const DtypeInfo& info(Dtype dtype) { return kDtypes[static_cast<std::size_t>(dtype)]; }

template <class T>
T value_at(const std::byte* data, std::size_t i) {
  T v;
  std::memcpy(&v, data + i * sizeof(T), sizeof(T));
  return v;
}

float from_bfloat(std::uint16_t b) { return std::bit_cast<float>(static_cast<std::uint32_t>(b) << 16); }

template <class Stored, class Out, class Convert>
void convert_all(const std::vector<std::byte>& raw, std::vector<Out>& out, Convert convert) {
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = convert(value_at<Stored>(raw.data(), i));
}

template <class Stored, class Out>
void convert_all(const std::vector<std::byte>& raw, std::vector<Out>& out) {
  convert_all<Stored>(raw, out, [](Stored v) { return static_cast<Out>(v); });
}

// Converts values of an integer type; false, with `out` unchanged, for the others.
template <class To>
bool convert_integers(Dtype dtype, const std::vector<std::byte>& bytes, std::vector<To>& out) {
  switch (dtype) {
    case Dtype::i64:
      convert_all<std::int64_t>(bytes, out);
      break;
    case Dtype::i32:
      convert_all<std::int32_t>(bytes, out);
      break;
    case Dtype::i16:
      convert_all<std::int16_t>(bytes, out);
      break;
    case Dtype::i8:
      convert_all<std::int8_t>(bytes, out);
      break;
    case Dtype::u64:
      convert_all<std::uint64_t>(bytes, out);
      break;
    case Dtype::u32:
      convert_all<std::uint32_t>(bytes, out);
      break;
    case Dtype::u16:
      convert_all<std::uint16_t>(bytes, out);
      break;
    case Dtype::u8:
    case Dtype::boolean:
      convert_all<std::uint8_t>(bytes, out);
      break;
    default:
      return false;
  }
  return true;
}

// The position in the header's text of the digits of the metadata's `sha256`; npos if they are not there literally. A
// key cannot occur inside a string, whose quotes are escaped, and no other object of a checked header has such a key.
std::size_t find_digest(const std::string& header) {
  constexpr std::string_view kKey = "\"sha256\"";
  for (std::size_t at = header.find(kKey); at != std::string::npos; at = header.find(kKey, at + 1)) {
    std::size_t i = at + kKey.size();
    const auto skip_blanks = [&] {
      while (i < header.size() && std::strchr(" \t\r\n", header[i]) != nullptr && header[i] != '\0') ++i;
    };
    skip_blanks();
    if (i >= header.size() || header[i] != ':') continue;
    ++i;
    skip_blanks();
    if (i >= header.size() || header[i] != '"') continue;
    if (header.size() - i > kDigits + 1 && header[i + 1 + kDigits] == '"') return i + 1;
  }
  return std::string::npos;
}

bool is_digest(const std::string& text) {
  return text.size() == kDigits && text.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
}

}  // namespace

std::size_t size_of(Dtype dtype) { return info(dtype).size; }
const char* name_of(Dtype dtype) { return info(dtype).name; }

long TensorEntry::count() const { return static_cast<long>(bytes / size_of(dtype)); }

std::string text_of(const Shape& shape) { return fmt::format("[{}]", fmt::join(shape, ", ")); }

// ----------------------------------------------------------------------------------------------------------------
// reader

class SafetensorsFile::Source {
 public:
  explicit Source(const std::string& path) : path_(path) {
    std::error_code problem;
    file_ = sys::open_to_read(path, problem);
    if (problem) fail(Status::file, "{}: cannot be opened: {}", path, problem.message());
    const std::optional<sys::FileFacts> found = sys::facts_of(file_, problem);
    if (!found || !found->is_file()) fail(Status::file, "{}: not a regular file", path);
    size_ = found->size;
  }
  explicit Source(std::span<const std::byte> memory) : memory_(memory), size_(memory.size()) {}
  std::uint64_t size() const { return size_; }

  void read(std::uint64_t offset, void* into, std::size_t bytes) const {
    if (!file_.good()) {
      if (bytes != 0) std::memcpy(into, memory_.subspan(offset, bytes).data(), bytes);
      return;
    }
    const HostSpan span(HostKind::file, "read", path_);
    std::error_code problem;
    const std::size_t got = sys::read_at(file_, offset, into, bytes, problem);
    if (problem) fail(Status::file, "{}: cannot be read at byte {}: {}", path_, offset + got, problem.message());
    if (got < bytes)
      fail(Status::file, "{}: ended at byte {} while it was read; it had {} bytes before", path_, offset + got, size_);
  }

 private:
  std::string path_;
  sys::Handle file_;  // empty: reads from `memory_`
  std::span<const std::byte> memory_;
  std::uint64_t size_ = 0;
};

namespace {

json parse_header(const std::string& path, const std::string& text) {
  constexpr int kDeepest = 3;
  json header = parse_json(path + ": the header", text, kDeepest);
  if (!header.is_object()) fail(Status::format, "{}: header is {}, expected an object", path, header.type_name());
  return header;
}

std::map<std::string, std::string> read_metadata(const std::string& path, const json& object) {
  if (!object.is_object())
    fail(Status::format, "{}: __metadata__ is {}, expected an object of strings", path, object.type_name());
  std::map<std::string, std::string> out;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_string())
      fail(Status::format, "{}: __metadata__ {} is {}, expected a string", path, printable(key), value.type_name());
    out[key] = value.get<std::string>();
  }
  return out;
}

std::uint64_t read_count(const std::string& path, const std::string& name, const char* field, const json& value) {
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > std::numeric_limits<std::int64_t>::max())
    fail(Status::format, "{}: tensor {}: {} holds {}, expected a whole number from 0", path, printable(name), field,
         printable(value.dump(-1, ' ', true)));
  return value.get<std::uint64_t>();
}

TensorEntry read_entry(const std::string& path, const std::string& name, const json& object) {
  const std::string who = fmt::format("{}: tensor {}", path, printable(name));
  if (!object.is_object()) fail(Status::format, "{}: its entry is {}, expected an object", who, object.type_name());
  for (const auto& [key, value] : object.items())
    if (key != "dtype" && key != "shape" && key != "data_offsets")
      fail(Status::format, "{}: unknown field {}, expected dtype, shape and data_offsets", who, printable(key));
  for (const char* key : {"dtype", "shape", "data_offsets"})
    if (!object.contains(key)) fail(Status::format, "{}: no field {}", who, key);

  TensorEntry entry;
  entry.name = name;
  const json& dtype = object["dtype"];
  const auto* known = std::find_if(std::begin(kDtypes), std::end(kDtypes),
                                   [&](const DtypeInfo& d) { return dtype.is_string() && dtype == d.name; });
  if (known == std::end(kDtypes))
    fail(Status::format, "{}: dtype {} is not known, expected F32, F16, BF16 or another of safetensors' types", who,
         printable(dtype.dump(-1, ' ', true)));
  entry.dtype = known->dtype;

  const json& shape = object["shape"];
  if (!shape.is_array()) fail(Status::format, "{}: shape is {}, expected a list", who, shape.type_name());
  std::uint64_t bytes = known->size;
  bool overflow = false, empty = false;
  for (const json& side : shape) {
    const std::uint64_t n = read_count(path, name, "shape", side);
    entry.shape.push_back(static_cast<long>(n));
    empty = empty || n == 0;
    overflow = overflow || __builtin_mul_overflow(bytes, std::max<std::uint64_t>(n, 1), &bytes);
  }
  if (overflow) fail(Status::format, "{}: shape {} is beyond any memory", who, printable(text_of(entry.shape)));
  if (empty) bytes = 0;

  const json& offsets = object["data_offsets"];
  if (!offsets.is_array() || offsets.size() != 2)
    fail(Status::format, "{}: data_offsets is not a list of two numbers", who);
  const std::uint64_t begin = read_count(path, name, "data_offsets", offsets[0]);
  const std::uint64_t end = read_count(path, name, "data_offsets", offsets[1]);
  if (end < begin || end - begin != bytes)
    fail(Status::format, "{}: data_offsets [{}, {}] hold {} bytes, expected {} for {} {}", who, begin, end,
         static_cast<std::int64_t>(end - begin), bytes, known->name, printable(text_of(entry.shape)));
  entry.offset = begin;
  entry.bytes = bytes;
  return entry;
}

}  // namespace

SafetensorsFile::SafetensorsFile(const std::string& path) : path_(path), source_(std::make_unique<Source>(path)) {
  read_header();
}

SafetensorsFile::SafetensorsFile(const std::string& name, std::span<const std::byte> content)
    : path_(name), source_(std::make_unique<Source>(content)) {
  read_header();
}

void SafetensorsFile::read_header() {
  const std::string& path = path_;
  const std::uint64_t size = source_->size();
  if (size < 8)
    fail(Status::format, "{}: {} bytes, too short for a safetensors file (8 bytes and a header)", path, size);
  std::uint64_t length = 0;
  source_->read(0, &length, 8);
  if (length > kMaxHeader)
    fail(Status::format, "{}: header of {} bytes, expected at most {} (not a safetensors file?)", path, length,
         kMaxHeader);
  if (length > size - 8)
    fail(Status::format, "{}: header of {} bytes, but only {} follow: the file is cut off, or not safetensors", path,
         length, size - 8);
  header_.resize(length);
  source_->read(8, header_.data(), length);

  const json header = parse_header(path, header_);
  for (const auto& [name, value] : header.items()) {
    if (name == "__metadata__")
      metadata_ = read_metadata(path, value);
    else
      tensors_.push_back(read_entry(path, name, value));
  }
  std::sort(tensors_.begin(), tensors_.end(), [](const TensorEntry& a, const TensorEntry& b) {
    return std::tie(a.offset, a.bytes, a.name) < std::tie(b.offset, b.bytes, b.name);
  });
  const std::uint64_t values = size - 8 - length;
  std::uint64_t expected = 0;
  for (TensorEntry& entry : tensors_) {
    if (entry.offset != expected)
      fail(Status::format, "{}: tensor {}: data_offsets begin at {}, expected {}: tensors {}", path,
           printable(entry.name), entry.offset, expected, entry.offset < expected ? "overlap" : "leave a hole");
    if (entry.bytes > values - expected)
      fail(Status::format, "{}: tensor {}: ends at byte {} of the values, but the file has {}: it is cut off", path,
           printable(entry.name), expected + entry.bytes, values);
    expected += entry.bytes;
    entry.offset += 8 + length;
    index_[entry.name] = static_cast<std::size_t>(&entry - tensors_.data());
  }
  if (expected != values)
    fail(Status::format, "{}: {} bytes of values, expected {} by the header", path, values, expected);
}

SafetensorsFile::~SafetensorsFile() = default;
SafetensorsFile::SafetensorsFile(SafetensorsFile&&) noexcept = default;

std::uint64_t SafetensorsFile::bytes() const { return source_->size(); }

const TensorEntry* SafetensorsFile::find(const std::string& name) const {
  const auto it = index_.find(name);
  return it == index_.end() ? nullptr : &tensors_[it->second];
}

const TensorEntry& SafetensorsFile::at(const std::string& name) const {
  const TensorEntry* entry = find(name);
  if (entry == nullptr) fail(Status::format, "{}: no tensor {}", path_, printable(name));
  return *entry;
}

std::vector<std::byte> SafetensorsFile::raw(const TensorEntry& entry) const {
  std::vector<std::byte> out(entry.bytes);
  source_->read(entry.offset, out.data(), out.size());
  return out;
}

std::vector<float> SafetensorsFile::floats(const TensorEntry& entry) const {
  std::vector<float> out(static_cast<std::size_t>(entry.count()));
  if (entry.dtype == Dtype::f32) {
    source_->read(entry.offset, out.data(), entry.bytes);
    return out;
  }
  const std::vector<std::byte> bytes = raw(entry);
  if (entry.dtype == Dtype::f64)
    convert_all<double>(bytes, out);
  else if (entry.dtype == Dtype::f16)
    convert_all<std::uint16_t>(bytes, out, from_half);
  else if (entry.dtype == Dtype::bf16)
    convert_all<std::uint16_t>(bytes, out, from_bfloat);
  else
    convert_integers(entry.dtype, bytes, out);
  return out;
}

std::vector<std::int64_t> SafetensorsFile::integers(const TensorEntry& entry) const {
  std::vector<std::int64_t> out(static_cast<std::size_t>(entry.count()));
  if (!convert_integers(entry.dtype, raw(entry), out))
    fail(Status::format, "{}: tensor {} is {}, expected integers", path_, printable(entry.name), name_of(entry.dtype));
  return out;
}

HashState SafetensorsFile::check_hash() const {
  const auto stated = metadata_.find("sha256");
  if (stated == metadata_.end()) return HashState::absent;
  const std::size_t at = find_digest(header_);
  if (!is_digest(stated->second) || at == std::string::npos || header_.compare(at, kDigits, stated->second) != 0)
    fail(Status::format, "{}: __metadata__ sha256 is \"{}\", expected {} hexadecimal digits", path_,
         printable(stated->second), kDigits);
  const std::uint64_t length = header_.size();
  std::string blank = header_;
  blank.replace(at, kDigits, kDigits, '0');
  Sha256 hash;
  hash.add(&length, 8);
  hash.add(blank.data(), blank.size());
  std::vector<char> chunk(1 << 20);
  for (std::uint64_t offset = 8 + length; offset < source_->size();) {
    const std::size_t n = static_cast<std::size_t>(std::min<std::uint64_t>(chunk.size(), source_->size() - offset));
    source_->read(offset, chunk.data(), n);
    hash.add(chunk.data(), n);
    offset += n;
  }
  std::string digest = stated->second;
  for (char& c : digest) c = static_cast<char>(c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c);
  return hash.hex() == digest ? HashState::matches : HashState::differs;
}

// ----------------------------------------------------------------------------------------------------------------
// writer

void write_safetensors(const std::string& path, const std::vector<TensorToWrite>& tensors,
                       const std::map<std::string, std::string>& metadata, bool with_hash) {
  nlohmann::ordered_json header = nlohmann::ordered_json::object();
  std::map<std::string, std::string> meta = metadata;
  if (with_hash) meta["sha256"] = std::string(kDigits, '0');
  if (!meta.empty()) header["__metadata__"] = meta;
  std::set<std::string> names;
  std::vector<std::uint64_t> sizes;
  std::uint64_t offset = 0;
  for (const TensorToWrite& tensor : tensors) {
    if (tensor.name == "__metadata__" || !names.insert(tensor.name).second)
      fail(Status::internal, "{}: tensor {} cannot be written twice or under that name", path, tensor.name);
    std::uint64_t bytes = size_of(tensor.dtype);
    for (const long n : tensor.shape) bytes *= static_cast<std::uint64_t>(n);
    header[tensor.name] = {
        {"dtype", name_of(tensor.dtype)}, {"shape", tensor.shape}, {"data_offsets", {offset, offset + bytes}}};
    sizes.push_back(bytes);
    offset += bytes;
  }
  std::string text;
  try {
    text = header.dump();
  } catch (const json::exception& e) {  // a name or a metadata value that is not UTF-8
    fail(Status::usage, "{}: cannot be written: {}", path, e.what());
  }
  text.append((8 - text.size() % 8) % 8, ' ');  // values start at a multiple of 8 bytes
  if (text.size() > kMaxHeader)
    fail(Status::usage, "{}: a header of {} bytes, at most {} are read", path, text.size(), kMaxHeader);
  const std::uint64_t length = text.size();

  if (with_hash) {
    Sha256 hash;
    hash.add(&length, 8);
    hash.add(text.data(), text.size());
    for (std::size_t i = 0; i < tensors.size(); ++i) hash.add(tensors[i].data, sizes[i]);
    text.replace(find_digest(text), kDigits, hash.hex());
  }
  OutputFile out(path);
  out.write(&length, 8);
  out.write(text);
  for (std::size_t i = 0; i < tensors.size(); ++i) out.write(tensors[i].data, sizes[i]);
  out.commit();
}

}  // namespace vsplat
