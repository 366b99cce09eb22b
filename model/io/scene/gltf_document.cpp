#include "model/io/scene/gltf_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "model/base/json_fields.h"
#include "model/io/reader/percent.h"
#include "model/io/scene/gltf_splats.h"
#include "model/io/views/listed_file.h"
#include "runtime/fail.h"
#include "runtime/files/base64.h"
#include "runtime/files/file.h"
#include "runtime/json_text.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

using nlohmann::json;

constexpr std::size_t kGlbHeader = 12, kGlbChunkHeader = 8;
constexpr std::uint32_t kJsonChunk = 0x4e4f534a, kBinaryChunk = 0x004e4942;

std::uint32_t word_at(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t out = 0;
  for (std::size_t i = 4; i-- > 0;) out = out << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
  return out;
}

std::string characters_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Component {
  int number;
  std::size_t bytes;
  double most;  // that stands for 1 if normalised; 0: no normalised numbers of this type
};
constexpr Component kComponents[] = {{5120, 1, 127},   {5121, 1, 255}, {5122, 2, 32767},
                                     {5123, 2, 65535}, {5125, 4, 0},   {5126, 4, 0}};

const Component* component_of(std::uint64_t number) {
  for (const Component& c : kComponents)
    if (static_cast<std::uint64_t>(c.number) == number) return &c;
  return nullptr;
}

template <class T>
double value_at(const std::byte* from) {
  T out;
  std::memcpy(&out, from, sizeof out);
  return static_cast<double>(out);
}

std::size_t width_of(const std::string& type) {
  return type == "SCALAR" ? 1 : type == "VEC2" ? 2 : type == "VEC3" ? 3 : type == "VEC4" ? 4 : 0;
}

}  // namespace

bool is_glb(std::span<const std::byte> beginning) {
  return beginning.size() >= 4 && word_at(beginning, 0) == 0x46546c67;
}

std::uint32_t glb_version(std::span<const std::byte> beginning) {
  return beginning.size() >= 8 ? word_at(beginning, 4) : 0;
}

GltfValue GltfValue::operator[](const std::string& name) const {
  if (!exists()) return *this;
  if (!value_->is_object()) expected("an object");
  const auto found = value_->find(name);
  const bool there = found != value_->end() && !found->is_null();
  return {*file_, there ? &*found : nullptr, place_.empty() ? name : place_ + "." + name};
}

GltfValue GltfValue::operator[](std::size_t i) const {
  if (i >= size()) wrong(fmt::format("has {} elements, and no number {}", size(), i));
  return {*file_, &(*value_)[i], fmt::format("{}[{}]", place_, i)};
}

std::size_t GltfValue::size() const {
  if (!exists()) return 0;
  if (!value_->is_array()) expected("a list");
  return value_->size();
}

std::vector<std::string> GltfValue::names() const {
  std::vector<std::string> out;
  if (!exists()) return out;
  if (!value_->is_object()) expected("an object");
  for (const auto& item : value_->items()) out.push_back(item.key());
  return out;
}

std::uint64_t GltfValue::whole() const {
  if (!exists() || !value_->is_number_unsigned()) expected("a whole number from 0");
  return value_->get<std::uint64_t>();
}

bool GltfValue::flag(bool otherwise) const {
  if (!exists()) return otherwise;
  if (!value_->is_boolean()) expected("true or false");
  return value_->get<bool>();
}

std::string GltfValue::text(const std::string& otherwise) const {
  if (!exists()) return otherwise;
  if (!value_->is_string()) expected("a string");
  return value_->get<std::string>();
}

std::vector<double> GltfValue::numbers(std::size_t count) const {
  if (!exists()) return {};
  const std::string what = fmt::format("{} finite numbers", count);
  if (!value_->is_array() || value_->size() != count) expected(what);
  std::vector<double> out;
  for (const nlohmann::json& v : *value_) {
    if (!v.is_number() || !std::isfinite(v.get<double>())) expected(what);
    out.push_back(v.get<double>());
  }
  return out;
}

void GltfValue::wrong(const std::string& text) const {
  fail(Status::format, "{}: {} {}", *file_, place_.empty() ? "its content" : printable(place_), text);
}

void GltfValue::expected(const std::string& what) const {
  wrong(fmt::format("is {}: {} expected", exists() ? json_fields::shown(*value_) : "missing", what));
}

double GltfNumbers::at(std::size_t element, std::size_t i) const {
  const Component& type = *component_of(static_cast<std::uint64_t>(component));
  const std::byte* from = data + element * stride + i * type.bytes;
  double out = 0;
  switch (component) {
    case 5120:
      out = value_at<std::int8_t>(from);
      break;
    case 5121:
      out = value_at<std::uint8_t>(from);
      break;
    case 5122:
      out = value_at<std::int16_t>(from);
      break;
    case 5123:
      out = value_at<std::uint16_t>(from);
      break;
    case 5125:
      out = value_at<std::uint32_t>(from);
      break;
    default:
      out = value_at<float>(from);
  }
  return normalized ? std::max(out / type.most, -1.0) : out;
}

GltfDocument::GltfDocument(std::string name, std::span<const std::byte> content, std::string folder)
    : name_(std::move(name)), folder_(std::move(folder)) {
  if (is_glb(content))
    split_glb(content);
  else
    json_ = parse_json(name_, characters_of(content));
  if (!json_.is_object()) fail(Status::format, "{}: no glTF file: an object is expected", name_);
  const std::string version = root()["asset"]["version"].text("");
  if (version.rfind("2.", 0) != 0)
    fail(Status::format, "{}: asset.version is \"{}\": glTF 2.0 is expected", name_, printable(version));
}

void GltfDocument::split_glb(std::span<const std::byte> content) {
  if (content.size() < kGlbHeader + kGlbChunkHeader)
    fail(Status::format, "{}: a GLB that ends after {} bytes, in its header", name_, content.size());
  if (word_at(content, 4) != 2)
    fail(Status::format, "{}: GLB version {} (byte 4): 2 is expected", name_, word_at(content, 4));
  const std::size_t length = word_at(content, 8);
  if (length > content.size())
    fail(Status::format, "{}: is cut off: its header (byte 8) says {} bytes, there are {}", name_, length,
         content.size());
  bool has_json = false;
  for (std::size_t at = kGlbHeader; at + kGlbChunkHeader <= length;) {
    const std::size_t bytes = word_at(content, at);
    const std::uint32_t kind = word_at(content, at + 4);
    if (bytes > length - at - kGlbChunkHeader)
      fail(Status::format, "{}: the chunk at byte {} says {} bytes, {} are left", name_, at, bytes,
           length - at - kGlbChunkHeader);
    const std::span<const std::byte> chunk = content.subspan(at + kGlbChunkHeader, bytes);
    if (!has_json && kind != kJsonChunk) fail(Status::format, "{}: the first chunk (byte {}) is no JSON", name_, at);
    if (!has_json) {
      json_ = parse_json(name_, characters_of(chunk));
      has_json = true;
    } else if (kind == kBinaryChunk && !has_chunk_) {
      chunk_ = chunk;
      has_chunk_ = true;
    }
    at += kGlbChunkHeader + bytes;
  }
  if (!has_json) fail(Status::format, "{}: has no JSON chunk", name_);
}

GltfValue GltfDocument::in(const char* list, const GltfValue& index) const {
  const std::uint64_t i = index.whole();
  const GltfValue all = root()[list];
  if (i >= all.size()) index.wrong(fmt::format("is {}: there are {} {}", i, all.size(), list));
  return all[static_cast<std::size_t>(i)];
}

std::filesystem::path GltfDocument::file_of(const GltfValue& uri) const {
  const std::string text = uri.text(""), decoded = percent_decoded(text);
  const std::filesystem::path file(decoded);
  const bool leaves = std::any_of(file.begin(), file.end(), [](const auto& part) { return part == ".."; });
  if (text.empty() || decoded.find('\0') != std::string::npos || file.is_absolute() || leaves ||
      text.find("://") != std::string::npos)
    uri.wrong(fmt::format("is \"{}\": the name of a file beside this one, or below its folder, is expected",
                          printable(text)));
  if (folder_.empty()) uri.wrong(fmt::format("is \"{}\": a scene in memory has no file beside it", printable(text)));
  const std::filesystem::path path = (std::filesystem::path(folder_) / file).lexically_normal();
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored)) return path;
  std::filesystem::path found = ListedFiles({folder_}).find_with_ending(decoded);
  if (found.empty())
    uri.wrong(fmt::format("is \"{}\": there is no file {}", printable(text), printable(path.string())));
  return found;
}

const GltfDocument::Loaded& GltfDocument::load(const GltfValue& uri, std::uint64_t number) {
  if (const auto known = decoded_.find(number); known != decoded_.end()) return known->second;
  const std::string text = uri.text("");
  if (!text.starts_with("data:")) {
    const auto [found, is_new] = files_.try_emplace(file_of(uri));
    if (!is_new) return found->second;
    std::error_code ignored;  // what is no regular file is refused when it is read
    const auto size = std::filesystem::file_size(found->first, ignored);
    if (!ignored) found->second.reserved = HostMemory(found->first.string(), static_cast<double>(size));
    found->second.bytes = read_file(found->first.string());
    return found->second;
  }
  const std::size_t comma = text.find(',');
  constexpr std::string_view mark = ";base64";
  const std::string_view head = std::string_view(text).substr(0, std::min(comma, text.size()));
  if (comma == std::string::npos || head.size() < mark.size() || head.substr(head.size() - mark.size()) != mark)
    uri.wrong("is a data: URI that is not base64");
  auto bytes = from_base64(std::string_view(text).substr(comma + 1));
  if (!bytes) uri.wrong("is a data: URI whose base64 is damaged");
  return decoded_[number] = Loaded{{}, std::move(*bytes)};
}

std::span<const std::byte> GltfDocument::buffer(const GltfValue& index) {
  const GltfValue of = in("buffers", index);
  const std::uint64_t number = index.whole(), bytes = of["byteLength"].whole();
  std::span<const std::byte> all = chunk_;
  if (of["uri"].exists()) {
    all = std::as_bytes(std::span(load(of["uri"], number).bytes));
  } else if (number != 0 || !has_chunk_) {
    of.wrong("has no uri, and there is no binary chunk for it");
  }
  if (bytes > all.size()) of["byteLength"].wrong(fmt::format("is {}: the buffer has {} bytes", bytes, all.size()));
  return all.first(static_cast<std::size_t>(bytes));
}

GltfNumbers GltfDocument::numbers(const GltfValue& accessor_index, std::size_t least, std::size_t most) {
  const GltfValue accessor = in("accessors", accessor_index);
  if (accessor["sparse"].exists()) accessor["sparse"].wrong("is not read: Gaussians in a whole buffer are expected");
  if (!accessor["bufferView"].exists()) accessor.wrong("has no bufferView");
  const GltfValue view = in("bufferViews", accessor["bufferView"]);
  if (!view["buffer"].exists()) view.wrong("has no buffer");
  if (const auto names = view["extensions"].names(); !names.empty())
    view.wrong(fmt::format("is compressed or changed by {}, which is not read", printable(names.front())));
  GltfNumbers out;
  out.place = accessor.place();
  const Component* type = component_of(accessor["componentType"].whole());
  if (!type) accessor["componentType"].wrong("is none of 5120 to 5123, 5125, 5126");
  out.component = type->number;
  out.normalized = accessor["normalized"].flag(false);
  if (out.normalized && type->most == 0) accessor["normalized"].wrong("is true for numbers that cannot be normalised");
  out.width = width_of(accessor["type"].text(""));
  if (out.width < least || out.width > most)
    accessor["type"].wrong(
        fmt::format("is \"{}\": {} numbers are expected for each Gaussian", printable(accessor["type"].text("")),
                    least == most ? fmt::format("{}", least) : fmt::format("{} or {}", least, most)));
  const std::span<const std::byte> bytes = buffer(view["buffer"]);
  const std::uint64_t view_at = view["byteOffset"].whole(0), view_bytes = view["byteLength"].whole();
  if (view_at > bytes.size() || view_bytes > bytes.size() - view_at)
    view.wrong(fmt::format("covers {} bytes from {}: the buffer has {}", view_bytes, view_at, bytes.size()));
  const std::size_t element = out.width * type->bytes;
  const std::uint64_t stride = view["byteStride"].whole(element);
  if (stride < element || stride > 252)
    view["byteStride"].wrong(fmt::format("is {}: {} to 252 is expected", stride, element));
  const std::uint64_t at = accessor["byteOffset"].whole(0), count = accessor["count"].whole();
  const std::uint64_t left = at > view_bytes ? 0 : view_bytes - at;
  if (count == 0) accessor["count"].wrong("is 0: at least 1 is expected");
  if (left < element || count - 1 > (left - element) / stride)
    accessor["count"].wrong(
        fmt::format("is {}: its view holds {} elements", count, left < element ? 0 : (left - element) / stride + 1));
  out.data = bytes.data() + view_at + at;
  out.count = static_cast<std::size_t>(count);
  out.stride = static_cast<std::size_t>(stride);
  return out;
}

}  // namespace vsplat
