#include "model/io/reader/program/hdf5_driver.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <iterator>
#include <memory>
#include <utility>

namespace vsplat::read {
namespace {

Library* opener = nullptr;

struct File {
  H5FD_t common{};  // first member: HDF5 casts between the addresses
  Descriptor file;
  struct stat found {};
  haddr_t allocated = 0;
};

File& self(H5FD_t* file) { return *reinterpret_cast<File*>(file); }
const File& self(const H5FD_t* file) { return *reinterpret_cast<const File*>(file); }

H5FD_t* open(const char* name, unsigned flags, hid_t, haddr_t) {
  if ((flags & (H5F_ACC_RDWR | H5F_ACC_TRUNC | H5F_ACC_CREAT)) != 0) return nullptr;
  try {
    auto out = std::make_unique<File>();
    out->file = opener->open(name);
    if (!out->file.good() || ::fstat(out->file.number(), &out->found) != 0) return nullptr;
    return &out.release()->common;
  } catch (const std::exception&) {
    return nullptr;
  }
}

herr_t close(H5FD_t* file) {
  delete &self(file);
  return 0;
}

int compare(const H5FD_t* a, const H5FD_t* b) {
  const auto key = [](const H5FD_t* f) { return std::pair(self(f).found.st_dev, self(f).found.st_ino); };
  return key(a) < key(b) ? -1 : key(b) < key(a) ? 1 : 0;
}

herr_t query(const H5FD_t*, unsigned long* flags) {
  if (flags)
    *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
             H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t allocated(const H5FD_t* file, H5FD_mem_t) { return self(file).allocated; }
herr_t allocate(H5FD_t* file, H5FD_mem_t, haddr_t end) {
  self(file).allocated = end;
  return 0;
}
haddr_t end_of_file(const H5FD_t* file, H5FD_mem_t) { return static_cast<haddr_t>(self(file).found.st_size); }

herr_t read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t at, std::size_t size, void* to) {
  auto* out = static_cast<char*>(to);
  if (at > static_cast<haddr_t>(INT64_MAX) - size) return -1;
  while (size > 0) {
    const ssize_t n = ::pread(self(file).file.number(), out, size, static_cast<off_t>(at));
    if (n < 0 && errno != EINTR) return -1;
    if (n == 0) {  // zeros beyond the end
      std::memset(out, 0, size);
      return 0;
    }
    if (n > 0) out += n, at += static_cast<haddr_t>(n), size -= static_cast<std::size_t>(n);
  }
  return 0;
}

herr_t write(H5FD_t*, H5FD_mem_t, hid_t, haddr_t, std::size_t, const void*) { return -1; }

H5FD_class_t driver() {
  H5FD_class_t out{};
#if H5_VERSION_GE(1, 13, 2)
  out.version = H5FD_CLASS_VERSION;
  out.value = static_cast<H5FD_class_value_t>(511);  // from the range for experiments
#endif
  out.name = "given";
  out.maxaddr = INT64_MAX;
  out.fc_degree = H5F_CLOSE_WEAK;
  out.open = open, out.close = close, out.cmp = compare, out.query = query;
  out.get_eoa = allocated, out.set_eoa = allocate, out.get_eof = end_of_file;
  out.read = read, out.write = write;
  const H5FD_mem_t kinds[] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(kinds), std::end(kinds), out.fl_map);
  return out;
}

}  // namespace

void take_files_from(Library& library, hid_t access) {
  static const H5FD_class_t given = driver();
  static const hid_t id = H5FDregister(&given);
  opener = &library;
  H5Pset_driver(access, id, nullptr);
}

}  // namespace vsplat::read
