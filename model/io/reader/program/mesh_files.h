// Files for assimp, opened by the library.
#pragma once
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <optional>
#include <vector>

#include "model/io/reader/program/library.h"
#include "model/io/reader/program/obj_text.h"

namespace vsplat::read {

// All bytes of a file that the library opens; nothing if it refuses.
std::optional<std::vector<unsigned char>> whole_file(const std::string& path, Library& library);

// The file's first bytes, at most `most`; empty if the library does not open it.
std::string beginning_of(const std::string& path, Library& library, std::size_t most);

class MeshFiles : public Assimp::IOSystem {
 public:
  // `materials` records what assimp ignores in MTL files.
  MeshFiles(Library& library, MtlMaterials& materials) : library_(library), materials_(materials) {}
  bool Exists(const char* path) const override { return library_.exists(path); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* path, const char* mode) override;
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  Library& library_;
  MtlMaterials& materials_;
};

}  // namespace vsplat::read
