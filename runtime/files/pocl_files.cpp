#include "runtime/files/pocl_files.h"

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>
#include <utility>

#include "runtime/fail.h"
#include "runtime/files/cache_folders.h"
#include "runtime/log.h"
#include "runtime/system/environment.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Bytes of a file, read as little-endian numbers; empty beyond its end.
class Bytes {
 public:
  Bytes() = default;
  explicit Bytes(std::vector<unsigned char> bytes) : bytes_(std::move(bytes)) {}
  bool empty() const { return bytes_.empty(); }
  std::uint64_t number(std::uint64_t at, int bytes) const {
    std::uint64_t out = 0;
    for (int i = bytes; i-- > 0;) out = out << 8 | bytes_.at(at + static_cast<std::uint64_t>(i));
    return out;
  }

 private:
  std::vector<unsigned char> bytes_;
};

class File {
 public:
  explicit File(const fs::path& path) {
    std::error_code problem;
    size_ = fs::file_size(path, problem);
    in_.rdbuf()->pubsetbuf(nullptr, 0);  // unbuffered: only a few bytes are read at scattered places
    in_.open(path, std::ios::binary);
    if (problem || !in_) size_ = 0;
  }
  std::uint64_t size() const { return size_; }
  bool holds(std::uint64_t at, std::uint64_t bytes) const { return at <= size_ && bytes <= size_ - at; }
  // Empty if the file does not have all of them.
  Bytes bytes(std::uint64_t at, std::uint64_t count) {
    if (!holds(at, count)) return {};
    std::vector<unsigned char> out(count);
    in_.seekg(static_cast<std::streamoff>(at));
    if (!in_.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(count))) return {};
    return Bytes(std::move(out));
  }

 private:
  std::ifstream in_;
  std::uint64_t size_ = 0;
};

constexpr const char* cut_off = "it is cut off, or its header is damaged";

// A table of an ELF file: each entry names a part of the file, which must exist.
struct Table {
  std::uint64_t at, entry, count;
  std::uint64_t offset, size;              // within an entry
  std::uint64_t kind, kind_without_bytes;  // the kind of entry that occupies no bytes of the file
};

bool is_whole(File& file, const Table& table) {
  const Bytes entries = file.bytes(table.at, table.entry * table.count);
  if (entries.empty()) return table.count == 0;
  for (std::uint64_t at = 0; at < table.entry * table.count; at += table.entry)
    if (entries.number(at + table.kind, 4) != table.kind_without_bytes &&
        !file.holds(entries.number(at + table.offset, 8), entries.number(at + table.size, 8)))
      return false;
  return true;
}

// Checks a 64-bit little-endian ELF library; of other formats only the magic number is checked.
std::string problem_of_library(File& file) {
  const Bytes begin = file.bytes(0, 6);
  if (begin.empty() || begin.number(0, 4) != 0x464c457f) return "it is no library";
  if (begin.number(4, 2) != 0x0102) return "";
  constexpr std::uint64_t no_bits = 8, program_entry = 56, section_entry = 64;
  const Bytes head = file.bytes(0, 64);
  if (head.empty() || head.number(54, 2) != program_entry || head.number(56, 2) == 0) return cut_off;
  const Table programs = {head.number(32, 8), program_entry, head.number(56, 2), 8, 32, 0, ~std::uint64_t{0}};
  const Table sections = {head.number(40, 8), section_entry, head.number(60, 2), 24, 32, 4, no_bits};
  return is_whole(file, programs) && is_whole(file, sections) ? "" : cut_off;
}

// Checks LLVM bitcode: blocks one after the other, each with its length.
std::string problem_of_bitcode(File& file) {
  const Bytes magic = file.bytes(0, 4);
  if (!magic.empty() && magic.number(0, 4) == 0x0b17c0de) return "";  // bitcode with a wrapper around it
  if (magic.empty() || magic.number(0, 4) != 0xdec04342) return "it is no bitcode of LLVM";
  constexpr std::uint64_t enter_block = 1;
  std::uint64_t at = 4;
  while (at < file.size()) {
    const Bytes block = file.bytes(at, 8);
    if (block.empty() || (block.number(0, 4) & 3) != enter_block || !file.holds(at + 8, 4 * block.number(4, 4)))
      return cut_off;
    at += 8 + 4 * block.number(4, 4);
  }
  return at > 4 ? "" : cut_off;
}

// "" if nothing is wrong, or if the format is unknown.
std::string problem_of(const fs::path& path) {
  const std::string ending = path.extension().string();
  if (ending != ".so" && ending != ".bc") return "";
  std::error_code problem;
  const fs::file_status status = fs::status(path, problem);
  if (!fs::exists(status)) return "";  // another process has removed it meanwhile
  if (!fs::is_regular_file(status)) return "it is no file";
  File file(path);
  if (file.size() == 0) return "it is empty";
  return ending == ".so" ? problem_of_library(file) : problem_of_bitcode(file);
}

}  // namespace

std::vector<DamagedFile> damaged_files(const std::string& folder) {
  std::vector<DamagedFile> out;
  std::error_code problem;
  for (auto at = fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied, problem);
       !problem && at != fs::recursive_directory_iterator(); at.increment(problem)) {
    const fs::path path = at->path();
    // Beside the folders of programs lie the files that processes are still writing; these move when they are complete.
    if (at.depth() == 0 || problem_of(path).empty()) continue;
    // The file may be being written right now.
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    if (const std::string what = problem_of(path); !what.empty()) out.push_back({path.string(), what});
  }
  return out;
}

void mend_pocl_files() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (environment("POCL_KERNEL_CACHE") == "0") return;
    const std::string folder = pocl_cache().path;
    const std::vector<DamagedFile> damaged = damaged_files(folder);
    for (const DamagedFile& file : damaged) {
      std::error_code problem;
      fs::remove_all(file.path, problem);
      if (problem)
        fail(Status::device,
             "{}: PoCL keeps compiled kernels here, and this one is damaged ({}) and cannot be removed: {}. PoCL would "
             "crash. Clear the folder with `rm -r {}`, or set POCL_CACHE_DIR to another one",
             file.path, file.what, problem.message(), folder);
    }
    if (!damaged.empty())
      warn("{}: PoCL keeps compiled kernels here, and this one was damaged ({}){}: removed, it is compiled again",
           damaged.front().path, damaged.front().what,
           damaged.size() > 1 ? fmt::format(", and {} more were", damaged.size() - 1) : "");
  });
}

void need_space_for_pocl() {
  constexpr std::size_t most = std::size_t{4} << 20;  // bytes of a kernel and of what its compiler writes meanwhile
  const std::string folder = pocl_cache().path;
  if (const std::error_code problem = try_writing(folder, most))
    fail(Status::file,
         "{}: {}, and the driver PoCL keeps compiled kernels there, in files of up to {} MiB. Free some space, or set "
         "POCL_CACHE_DIR to a folder that has it",
         folder, problem.message(), most >> 20);
}

}  // namespace vsplat
