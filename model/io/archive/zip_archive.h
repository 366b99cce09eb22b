// Zip archives as torch.save makes them: entries are stored as they are, none is compressed.
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

  // Reads the list and no content. Error(format) for an archive that is inconsistent, for an entry that is compressed
  // or encrypted (so that nothing is larger than the file), and for names that are there twice, lead out of a folder or
  // hold what a terminal would act upon.
  explicit ZipArchive(const std::string& path);
  ~ZipArchive();
  ZipArchive(const ZipArchive&) = delete;
  ZipArchive& operator=(const ZipArchive&) = delete;

  const std::map<std::string, Entry>& entries() const { return entries_; }
  // All of one, whose checksum is compared.
  std::vector<unsigned char> read(const std::string& name, const Entry& entry) const;
  // The same, of which nothing is kept.
  void verify(const std::string& name, const Entry& entry) const;

 private:
  // Its size, which is at most `left`.
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
