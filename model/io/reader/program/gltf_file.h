// A glTF 2.0 file: its JSON, and the bytes that its buffers and pictures are made of.
#pragma once
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "model/io/reader/program/gltf_json.h"
#include "model/io/reader/program/library.h"

namespace vsplat::read {

using Bytes = std::span<const unsigned char>;

class GltfFile {
 public:
  // Reads the file, JSON or GLB whatever its ending is. None where it is glTF 1.0.
  static std::unique_ptr<GltfFile> open(const std::string& path, Library& library);

  Field root() const { return {&json_, ""}; }
  Field list(const char* name) const { return root()[name]; }

  // The bytes of a buffer view, by the field that has its number; decompressed.
  Bytes view(const Field& number);
  // The bytes of a data URI. None where it is another URI.
  std::optional<std::vector<unsigned char>> inside(const Field& uri) const;
  // The name of a file, relative to this one's folder, that a URI leads to: decoded, or as it stands where only that
  // is there.
  std::string file_of(const Field& uri);

 private:
  GltfFile(std::string path, Library& library) : path_(std::move(path)), library_(library) {}
  bool read();
  void split(Bytes file);
  void parse(Bytes text);
  std::string beside(const std::string& name) const;
  const std::vector<unsigned char>& buffer(const Field& number);
  std::vector<unsigned char> read_buffer(const Field& of, bool first);
  std::vector<unsigned char> decompressed(const Field& extension);

  std::string path_;
  Library& library_;
  nlohmann::json json_;
  bool binary_ = false, first_version_ = false;
  std::vector<unsigned char> chunk_;                                // of a GLB: its first buffer
  std::map<std::size_t, std::vector<unsigned char>> buffers_;       // by number
  std::map<std::size_t, std::vector<unsigned char>> decompressed_;  // views, by number
};

}  // namespace vsplat::read
