// Files of torch.save (.ckpt, .pth, .pt): a zip archive with a pickle and raw arrays. Reads the names, shapes and
// values of the tensors in a state dict, bare or in a Lightning checkpoint. Nothing in the file is ever executed.
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
  // Whether the file begins like one of torch.save, of any version. False also if it cannot be read.
  static bool looks_like(const std::string& path);

  // Checks the archive's directory, its pickle and the location of every tensor completely. Error(format) for anything
  // that does not belong to a state dict.
  explicit TorchFile(const std::string& path);
  ~TorchFile();
  TorchFile(TorchFile&&) noexcept;

  const std::string& path() const { return path_; }
  // The tensors of the state dict, in its order. Their names are without what DataParallel and torch.compile add. An
  // entry's offset is meaningless; its size is that of its elements.
  const std::vector<TensorEntry>& tensors() const { return tensors_; }
  const TensorEntry* find(const std::string& name) const;  // null if there is no such tensor
  const TensorEntry& at(const std::string& name) const;    // Error(format) with the name if there is no such tensor
  // Keys beside the state dict, such as optimizer_states, and its entries that are not tensors.
  const std::vector<std::string>& others() const { return others_; }

  // Values in row-major order, for any strides. Any dtype is converted to float as by SafetensorsFile::floats(). The
  // tensor's whole storage is reserved from the host budget.
  std::vector<float> floats(const TensorEntry& entry) const;
  // Sum over all entries of the archive.
  std::uint64_t stored_bytes() const;
  // Reads every entry of the archive; Error(format) if one does not match its checksum.
  void verify() const;

 private:
  class Archive;
  struct Layout;

  std::string path_;
  std::unique_ptr<Archive> archive_;
  std::vector<TensorEntry> tensors_;
  std::vector<Layout> layouts_;  // parallel to tensors_
  std::map<std::string, std::size_t> index_;
  std::vector<std::string> others_;
};

}  // namespace vsplat
