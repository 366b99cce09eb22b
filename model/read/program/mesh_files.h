// The files that assimp reads: those that the library opens.
#pragma once
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>

#include "model/read/program/library.h"

namespace vsplat::read {

class MeshFiles : public Assimp::IOSystem {
 public:
  explicit MeshFiles(Library& library) : library_(library) {}
  bool Exists(const char* path) const override { return library_.exists(path); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* path, const char* mode) override;
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  Library& library_;
};

}  // namespace vsplat::read
