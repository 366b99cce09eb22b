// A glTF 2.0 file: its JSON, and the bytes of its buffers and pictures.
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
  // Reads the file, JSON or GLB, regardless of its ending. Null if it is glTF 1.0.
  static std::unique_ptr<GltfFile> open(const std::string& path, Library& library);

  Field root() const { return {&json_, ""}; }
  Field list(const char* name) const { return root()[name]; }

  // The decompressed bytes of the buffer view that `number` refers to.
  Bytes view(const Field& number);
  // The bytes of a data URI; nothing for any other URI.
  std::optional<std::vector<unsigned char>> inside(const Field& uri) const;
  // The file that a URI refers to, relative to this file's folder: the decoded name, or the name as written if only
  // that exists.
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
  std::map<std::size_t, std::vector<unsigned char>> buffers_;       // by index
  std::map<std::size_t, std::vector<unsigned char>> decompressed_;  // views, by index
};

}  // namespace vsplat::read
