// Zip archives as torch.save writes them: all entries are stored uncompressed.
#pragma once
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

struct zip;

namespace vsplat {

class ZipArchive {
 public:
  struct Entry {
    std::uint64_t index = 0, bytes = 0;
  };

  // Reads the directory and no content. Error(format) for a damaged directory, for a compressed or encrypted entry (so
  // nothing is larger than the file), and for names that are duplicate, leave the folder or contain control characters.
  explicit ZipArchive(const std::string& path);
  ~ZipArchive();
  ZipArchive(const ZipArchive&) = delete;
  ZipArchive& operator=(const ZipArchive&) = delete;

  const std::map<std::string, Entry>& entries() const { return entries_; }
  // The complete entry; its checksum is compared.
  std::vector<unsigned char> read(const std::string& name, const Entry& entry) const;
  // As read(), without storing the content.
  void verify(const std::string& name, const Entry& entry) const;

 private:
  // Returns the entry's size, which is at most `left`.
  std::uint64_t add(std::uint64_t index, std::uint64_t left);
  template <class Take>
  void read_all(const std::string& name, const Entry& entry, std::size_t piece, Take take) const;

  std::string path_;
  struct Closer {
    void operator()(zip* archive) const;
  };
  std::unique_ptr<zip, Closer> archive_;
  std::map<std::string, Entry> entries_;
};

}  // namespace vsplat
