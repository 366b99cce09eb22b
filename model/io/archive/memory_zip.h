// Zip archives in memory: files of a few entries that are all wanted.
#pragma once
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

struct zip;

namespace vsplat {

// Reads an archive whose bytes outlive it. Entries may be compressed.
class MemoryZip {
 public:
  // `name` is the archive's path in messages. Error(format) if it is damaged or cut off.
  MemoryZip(std::string name, std::span<const std::byte> content);
  ~MemoryZip();
  MemoryZip(const MemoryZip&) = delete;
  MemoryZip& operator=(const MemoryZip&) = delete;

  // The complete entry; its checksum is compared. Error(format) if there is none, if it is encrypted or damaged, or if
  // it claims more bytes than its compressed form can hold. Error(memory) beyond the host budget.
  std::vector<unsigned char> read(const std::string& entry) const;

 private:
  std::string name_;
  std::size_t size_;
  struct Closer {
    void operator()(zip* archive) const;
  };
  std::unique_ptr<zip, Closer> archive_;
};

using NamedBytes = std::pair<std::string, std::vector<unsigned char>>;

// An archive of these entries, stored uncompressed in this order. The same entries give the same bytes.
std::vector<unsigned char> make_zip(const std::vector<NamedBytes>& entries);

}  // namespace vsplat
