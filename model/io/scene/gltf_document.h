// A glTF 2.0 file of Gaussians: its JSON with places for messages, its buffers, and the numbers of its accessors.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "runtime/system/host_memory.h"

namespace vsplat {

// A value or its absence, with the file's name and the value's place: "meshes[0].primitives[1].mode". A value of
// another type than is asked for is an Error(format).
class GltfValue {
 public:
  GltfValue(const std::string& file, const nlohmann::json* value, std::string place)
      : file_(&file), value_(value), place_(std::move(place)) {}

  bool exists() const { return value_ != nullptr; }
  const std::string& place() const { return place_; }

  GltfValue operator[](const std::string& name) const;  // of an object, or absent
  GltfValue operator[](std::size_t i) const;            // of an array, which must have it
  std::size_t size() const;                             // of an array; 0 if absent
  std::vector<std::string> names() const;               // of an object; none if absent

  std::uint64_t whole() const;
  std::uint64_t whole(std::uint64_t otherwise) const { return exists() ? whole() : otherwise; }
  bool flag(bool otherwise) const;
  std::string text(const std::string& otherwise) const;
  std::vector<double> numbers(std::size_t count) const;  // finite; empty if absent
  const nlohmann::json& json() const { return *value_; }

  [[noreturn]] void wrong(const std::string& text) const;

 private:
  [[noreturn]] void expected(const std::string& what) const;

  const std::string* file_;
  const nlohmann::json* value_;
  std::string place_;
};

// Elements of `width` numbers each.
struct GltfNumbers {
  const std::byte* data = nullptr;
  std::size_t count = 0, width = 0, stride = 0;
  int component = 0;  // 5120 to 5126, glTF's number for the type
  bool normalized = false;
  std::string place;

  // Normalised integers as fractions, others as they are.
  double at(std::size_t element, std::size_t i) const;
};

class GltfDocument {
 public:
  // Buffers may be files below `folder`; "": none may. The content must outlive the document. Error(format) for a
  // damaged GLB, invalid JSON, and another version than 2.
  GltfDocument(std::string name, std::span<const std::byte> content, std::string folder);
  GltfDocument(const GltfDocument&) = delete;
  GltfDocument& operator=(const GltfDocument&) = delete;

  const std::string& name() const { return name_; }
  GltfValue root() const { return {name_, &json_, ""}; }
  // The element of the root's `list` that this index names.
  GltfValue in(const char* list, const GltfValue& index) const;
  // The accessor's elements, which are in its buffer completely, and have one of the widths from `least` to `most`.
  GltfNumbers numbers(const GltfValue& accessor_index, std::size_t least, std::size_t most);

 private:
  void split_glb(std::span<const std::byte> content);
  struct Loaded {
    HostMemory reserved;
    std::vector<unsigned char> bytes;
  };

  std::span<const std::byte> buffer(const GltfValue& index);
  const Loaded& load(const GltfValue& uri, std::uint64_t number);
  std::filesystem::path file_of(const GltfValue& uri) const;

  std::string name_, folder_;
  nlohmann::json json_;
  bool has_chunk_ = false;
  std::span<const std::byte> chunk_;               // of a GLB: its first buffer
  std::map<std::uint64_t, Loaded> decoded_;        // buffers in data: URIs, by index
  std::map<std::filesystem::path, Loaded> files_;  // several buffers may name one
};

}  // namespace vsplat
