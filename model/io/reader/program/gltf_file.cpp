#include "model/io/reader/program/gltf_file.h"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <array>
#include <cstring>
#include <string_view>

#include "model/io/reader/percent.h"
#include "model/io/reader/program/mesh_files.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

std::uint32_t number_at(Bytes bytes, std::size_t at) {
  std::uint32_t out = 0;
  std::memcpy(&out, bytes.data() + at, sizeof out);
  return out;
}

[[noreturn]] void unreadable(const std::string& why) {
  fail_reading(Status::format, "", "cannot be read as a mesh: " + why);
}

std::optional<std::vector<unsigned char>> from_base64(std::string_view text) {
  static const std::array<int, 256> values = [] {
    std::array<int, 256> out{};
    out.fill(-1);
    constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (std::size_t i = 0; i < digits.size(); ++i) out[static_cast<unsigned char>(digits[i])] = static_cast<int>(i);
    out['-'] = 62, out['_'] = 63;
    return out;
  }();
  std::vector<unsigned char> out;
  out.reserve(text.size() / 4 * 3 + 3);
  unsigned bits = 0, have = 0;
  for (const char c : text) {
    if (c == '=') break;
    if (c == '\n' || c == '\r' || c == ' ') continue;
    const int value = values[static_cast<unsigned char>(c)];
    if (value < 0) return std::nullopt;
    bits = bits << 6 | static_cast<unsigned>(value);
    have += 6;
    if (have >= 8) have -= 8, out.push_back(static_cast<unsigned char>(bits >> have));
  }
  return out;
}

// The part of a buffer that the field's byteOffset and byteLength describe.
Bytes part_of(const std::vector<unsigned char>& buffer, const Field& by) {
  const std::uint64_t offset = by["byteOffset"].whole(0), size = by["byteLength"].whole();
  if (offset > buffer.size() || size > buffer.size() - offset)
    by.wrong(fmt::format("{} bytes from byte {} on are beyond the buffer's {} bytes", size, offset, buffer.size()));
  return Bytes(buffer).subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(size));
}

// The encoding of a compressed buffer view.
struct Packing {
  std::size_t count, stride;
  std::string mode, filter;
};

int decode(const Packing& by, Bytes from, void* to) {
  if (by.mode == "TRIANGLES") return meshopt_decodeIndexBuffer(to, by.count, by.stride, from.data(), from.size());
  if (by.mode == "INDICES") return meshopt_decodeIndexSequence(to, by.count, by.stride, from.data(), from.size());
  const int code = meshopt_decodeVertexBuffer(to, by.count, by.stride, from.data(), from.size());
  if (code != 0) return code;
  if (by.filter == "OCTAHEDRAL") meshopt_decodeFilterOct(to, by.count, by.stride);
  if (by.filter == "QUATERNION") meshopt_decodeFilterQuat(to, by.count, by.stride);
  if (by.filter == "EXPONENTIAL") meshopt_decodeFilterExp(to, by.count, by.stride);
  return 0;
}

// Checks the preconditions that meshoptimizer asserts.
Packing packing_of(const Field& extension) {
  Packing out{extension["count"].whole(), extension["byteStride"].whole(), extension["mode"].text(),
              extension["filter"].text("NONE")};
  const std::size_t stride = out.stride;
  const bool vertices = out.mode == "ATTRIBUTES";
  if (!vertices && out.mode != "TRIANGLES" && out.mode != "INDICES")
    extension["mode"].wrong(
        fmt::format("\"{}\" is not known: ATTRIBUTES, TRIANGLES or INDICES is expected", printable(out.mode)));
  if (vertices ? stride == 0 || stride % 4 != 0 || stride > 256 : stride != 2 && stride != 4)
    extension["byteStride"].wrong(
        fmt::format("is {}; {} is expected", stride, vertices ? "a multiple of 4 up to 256" : "2 or 4"));
  if (out.mode == "TRIANGLES" && out.count % 3 != 0)
    extension["count"].wrong(fmt::format("is {}; a multiple of 3 is expected", out.count));
  const std::string& filter = out.filter;
  const bool fits =
      filter == "NONE" || (vertices && ((filter == "OCTAHEDRAL" && (stride == 4 || stride == 8)) ||
                                        (filter == "QUATERNION" && stride == 8) || filter == "EXPONENTIAL"));
  if (!fits)
    extension["filter"].wrong(
        fmt::format("\"{}\" of {} with {} bytes each is not read", printable(filter), out.mode, stride));
  return out;
}

}  // namespace

std::unique_ptr<GltfFile> GltfFile::open(const std::string& path, Library& library) {
  std::unique_ptr<GltfFile> out(new GltfFile(path, library));
  return out->read() ? std::move(out) : nullptr;
}

bool GltfFile::read() {
  const auto file = whole_file(path_, library_);
  if (!file) unreadable("the file cannot be opened");
  if (file->size() >= 4 && std::memcmp(file->data(), "glTF", 4) == 0)
    split(*file);
  else
    parse(*file);
  if (first_version_) return false;
  if (!json_.is_object()) unreadable("its JSON is no object");
  const std::string version = root()["asset"]["version"].text();
  if (version.empty()) unreadable("asset.version is missing; it is not a glTF file");
  if (version[0] == '1') return false;
  if (version[0] != '2') unreadable(fmt::format("it is glTF {}; 2.0 is expected", printable(version)));
  if (const std::string least = root()["asset"]["minVersion"].text(); !least.empty() && least != "2.0")
    unreadable(fmt::format("it needs a reader of glTF {}; 2.0 is read", printable(least)));
  return true;
}

// Splits a GLB file: a header of 12 bytes, then chunks with a length and a type; the first is JSON, the second the
// first buffer.
void GltfFile::split(Bytes file) {
  constexpr std::uint32_t json = 0x4e4f534a, bin = 0x004e4942;
  if (file.size() < 20) unreadable(fmt::format("a GLB of {} bytes: it is cut off", file.size()));
  binary_ = true;
  first_version_ = number_at(file, 4) == 1;
  if (first_version_) return;
  if (number_at(file, 4) != 2) unreadable(fmt::format("GLB version {}; 2 is expected", number_at(file, 4)));
  std::size_t at = 12;
  for (int chunk = 0; chunk < 2 && file.size() - at >= 8; ++chunk) {
    const std::size_t size = number_at(file, at);
    const std::uint32_t type = number_at(file, at + 4);
    at += 8;
    if (size > file.size() - at)
      unreadable(fmt::format("a GLB whose chunk at byte {} claims {} bytes, {} follow: it is cut off or damaged", at,
                             size, file.size() - at));
    if ((chunk == 0) != (type == json)) unreadable("a GLB must have its JSON in the first chunk and in no other");
    if (chunk == 0) parse(file.subspan(at, size));
    if (type == bin)
      chunk_.assign(file.begin() + static_cast<std::ptrdiff_t>(at),
                    file.begin() + static_cast<std::ptrdiff_t>(at + size));
    at += size;
  }
}

void GltfFile::parse(Bytes text) {
  if (binary_)
    while (!text.empty() && text.back() == 0) text = text.first(text.size() - 1);  // some writers pad with zeros
  try {
    json_ = nlohmann::json::parse(text.begin(), text.end());
  } catch (const nlohmann::json::exception& e) {
    const std::string_view why = e.what();  // "[json.exception.parse_error.101] parse error at ..."
    const std::size_t end = why.find("] ");
    unreadable(fmt::format("it is neither JSON nor GLB, or damaged: {}",
                           printable(why.substr(end == why.npos ? 0 : end + 2))));
  }
}

std::string GltfFile::beside(const std::string& name) const {
  return path_.substr(0, path_.rfind('/') + 1) + name;  // rfind's npos + 1 is 0
}

std::optional<std::vector<unsigned char>> GltfFile::inside(const Field& uri) const {
  const std::string text = uri.text();
  if (!text.starts_with("data:")) return std::nullopt;
  const std::size_t comma = text.find(',');
  if (comma == text.npos) uri.wrong("is a data URI without a comma");
  const std::string_view data = std::string_view(text).substr(comma + 1);
  if (!text.substr(0, comma).ends_with(";base64")) {
    const std::string plain = percent_decoded(data);
    return std::vector<unsigned char>(plain.begin(), plain.end());
  }
  auto out = from_base64(data.find('%') == data.npos ? std::string(data) : percent_decoded(data));
  if (!out) uri.wrong("is a data URI whose data are not base64");
  return out;
}

std::string GltfFile::file_of(const Field& uri) {
  const std::string written = uri.text(), decoded = percent_decoded(written);
  if (written.find("://") != written.npos)
    uri.wrong(fmt::format("is {}: nothing is read over a network; put the file beside this one", printable(written)));
  if (decoded.find('\0') != decoded.npos) uri.wrong("holds a zero byte: a file's name is expected");
  if (decoded == written || library_.exists(beside(decoded))) return decoded;
  return library_.exists(beside(written)) ? written : decoded;
}

std::vector<unsigned char> GltfFile::read_buffer(const Field& of, bool first) {
  const Field uri = of["uri"];
  const std::uint64_t size = of["byteLength"].whole();
  std::string where = "it";
  std::vector<unsigned char> out;
  if (!uri.there()) {
    if (!binary_ || !first) of.wrong("has no uri and is not the first buffer of a GLB: it has no bytes");
    out = std::move(chunk_);
  } else if (auto data = inside(uri)) {
    out = std::move(*data);
  } else {
    where = file_of(uri);
    auto file = whole_file(beside(where), library_);
    if (!file)
      fail_reading(Status::input, uri.place(), fmt::format("its buffer {} is missing; add the file", printable(where)));
    out = std::move(*file);
  }
  if (out.size() < size)
    of.wrong(
        fmt::format("byteLength is {}, {} has {} bytes: it is cut off or damaged", size, printable(where), out.size()));
  out.resize(static_cast<std::size_t>(size));
  return out;
}

const std::vector<unsigned char>& GltfFile::buffer(const Field& number) {
  const std::size_t i = number.index(list("buffers").size(), "buffers");
  auto known = buffers_.find(i);
  if (known == buffers_.end()) known = buffers_.emplace(i, read_buffer(list("buffers")[i], i == 0)).first;
  return known->second;
}

std::vector<unsigned char> GltfFile::decompressed(const Field& extension) {
  const Bytes packed = part_of(buffer(extension["buffer"]), extension);
  const Packing by = packing_of(extension);
  // The best compression takes one bit for four numbers.
  if (by.count / 64 > packed.size())
    extension.wrong(fmt::format("{} bytes cannot hold its {} elements: it is damaged", packed.size(), by.count));
  std::vector<unsigned char> out(by.count * by.stride);
  if (!out.empty() && decode(by, packed, out.data()) != 0)
    extension.wrong("cannot be decompressed: it is damaged, or of a version of meshoptimizer that is not read");
  return out;
}

Bytes GltfFile::view(const Field& number) {
  const std::size_t i = number.index(list("bufferViews").size(), "bufferViews");
  const Field view = list("bufferViews")[i];
  for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    const Field extension = view["extensions"][name];
    if (!extension.there()) continue;
    auto known = decompressed_.find(i);
    if (known == decompressed_.end()) known = decompressed_.emplace(i, decompressed(extension)).first;
    return known->second;
  }
  return part_of(buffer(view["buffer"]), view);
}

}  // namespace vsplat::read
