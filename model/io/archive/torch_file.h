// Files of torch.save (.ckpt, .pth, .pt): a zip archive with a pickle and raw arrays. Of a state dict, bare or in a
// checkpoint of Lightning's, the tensors' names, shapes and values; nothing in the file is ever run.
#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "runtime/files/safetensors.h"

namespace vsplat {

class TorchFile {
 public:
  // Whether the file begins as one of torch.save's, of whatever version; false for what cannot be read, too.
  static bool looks_like(const std::string& path);

  // The archive's list, its pickle and where every tensor lies are checked in full. Error(format) for all that is not a
  // state dict's.
  explicit TorchFile(const std::string& path);
  ~TorchFile();
  TorchFile(TorchFile&&) noexcept;

  const std::string& path() const { return path_; }
  // Of the state dict, in its order. An entry's offset means nothing, and its bytes are those of its elements.
  const std::vector<TensorEntry>& tensors() const { return tensors_; }
  const TensorEntry* find(const std::string& name) const;  // null where there is none
  const TensorEntry& at(const std::string& name) const;    // Error(format) that names it
  // Keys beside the state dict, such as optimizer_states, and what in it is no tensor.
  const std::vector<std::string>& others() const { return others_; }

  // Row by row, whatever the strides. Any dtype becomes float, as SafetensorsFile::floats() has it. The host's budget
  // has to have room for the storage that it lies in.
  std::vector<float> floats(const TensorEntry& entry) const;
  // Of all entries of the archive.
  std::uint64_t stored_bytes() const;
  // Reads every entry of the archive: Error(format) where one does not match its checksum.
  void verify() const;

 private:
  class Archive;
  struct Layout;

  std::string path_;
  std::unique_ptr<Archive> archive_;
  std::vector<TensorEntry> tensors_;
  std::vector<Layout> layouts_;  // of each
  std::map<std::string, std::size_t> index_;
  std::vector<std::string> others_;
};

}  // namespace vsplat
