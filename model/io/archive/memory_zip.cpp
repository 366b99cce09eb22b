#include "model/io/archive/memory_zip.h"

#include <zip.h>

#include <algorithm>
#include <cstdint>

#include "runtime/fail.h"
#include "runtime/printable.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

// The most bytes that deflate can make of one.
constexpr std::uint64_t kMostInflated = 1032;

struct OpenEntry {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

struct OwnedSource {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};

// Message of a libzip error; frees the error.
std::string message_of(zip_error_t& error) {
  std::string out = zip_error_strerror(&error);
  zip_error_fini(&error);
  return out;
}

}  // namespace

void MemoryZip::Closer::operator()(zip* archive) const { zip_discard(archive); }

MemoryZip::MemoryZip(std::string name, std::span<const std::byte> content)
    : name_(std::move(name)), size_(content.size()) {
  zip_error_t error;
  zip_error_init(&error);
  std::unique_ptr<zip_source_t, OwnedSource> source(
      zip_source_buffer_create(content.data(), content.size(), 0, &error));
  if (!source) fail(Status::memory, "{}: its archive cannot be opened: {}", name_, message_of(error));
  archive_.reset(zip_open_from_source(source.get(), ZIP_RDONLY | ZIP_CHECKCONS, &error));
  if (!archive_)
    fail(Status::format, "{}: a damaged or cut-off zip archive ({} bytes): {}", name_, size_, message_of(error));
  static_cast<void>(source.release());  // now owned by the archive
  zip_error_fini(&error);
}

MemoryZip::~MemoryZip() = default;

std::vector<unsigned char> MemoryZip::read(const std::string& entry) const {
  zip_stat_t found;
  zip_stat_init(&found);
  constexpr zip_uint64_t needed = ZIP_STAT_INDEX | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE;
  if (zip_stat(archive_.get(), entry.c_str(), ZIP_FL_ENC_RAW, &found) != 0 || (found.valid & needed) != needed)
    fail(Status::format, "{}: its archive has no entry {}", name_, printable(entry));
  if ((found.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && found.encryption_method != ZIP_EM_NONE)
    fail(Status::format, "{}: entry {} of its archive is encrypted", name_, printable(entry));
  if (found.comp_size > size_ || found.size > kMostInflated * found.comp_size)
    fail(Status::format, "{}: entry {} of its archive claims {} bytes in {}, which the file of {} bytes cannot hold",
         name_, printable(entry), found.size, found.comp_size, size_);
  const HostMemory reserved(name_ + ": unpacking " + printable(entry), static_cast<double>(found.size));
  const std::unique_ptr<zip_file_t, OpenEntry> file(zip_fopen_index(archive_.get(), found.index, 0));
  if (!file)
    fail(Status::format, "{}: entry {} of its archive cannot be read: {}", name_, printable(entry),
         zip_strerror(archive_.get()));
  // One byte more than is expected, so that the end is read, where libzip compares the checksum.
  std::vector<unsigned char> out(static_cast<std::size_t>(found.size) + 1);
  std::size_t done = 0;
  while (done < out.size()) {
    const zip_int64_t got = zip_fread(file.get(), &out[done], out.size() - done);
    if (got < 0)
      fail(Status::format, "{}: entry {} of its archive is damaged or cut off: {}", name_, printable(entry),
           zip_file_strerror(file.get()));
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  if (done != found.size)
    fail(Status::format, "{}: entry {} of its archive does not have the {} bytes that its list says", name_,
         printable(entry), found.size);
  out.pop_back();
  return out;
}

std::vector<unsigned char> make_zip(const std::vector<NamedBytes>& entries) {
  zip_error_t error;
  zip_error_init(&error);
  const std::unique_ptr<zip_source_t, OwnedSource> made(zip_source_buffer_create(nullptr, 0, 0, &error));
  zip_t* archive = made ? zip_open_from_source(made.get(), ZIP_CREATE | ZIP_TRUNCATE, &error) : nullptr;
  if (!archive) fail(Status::memory, "no archive can be made: {}", message_of(error));
  zip_source_keep(made.get());  // zip_close() releases the archive's own reference
  for (const auto& [name, bytes] : entries) {
    zip_source_t* source = zip_source_buffer(archive, bytes.data(), bytes.size(), 0);
    const zip_int64_t at = source ? zip_file_add(archive, name.c_str(), source, ZIP_FL_ENC_UTF_8) : -1;
    constexpr zip_uint16_t first_day = 0x21;  // 1980-01-01, the earliest date: a clock would change the bytes
    if (at < 0 || zip_set_file_compression(archive, static_cast<zip_uint64_t>(at), ZIP_CM_STORE, 0) != 0 ||
        zip_file_set_dostime(archive, static_cast<zip_uint64_t>(at), 0, first_day, 0) != 0) {
      const std::string why = zip_strerror(archive);
      if (source && at < 0) zip_source_free(source);
      zip_discard(archive);
      fail(Status::memory, "no archive can be made of {}: {}", name, why);
    }
  }
  if (zip_close(archive) != 0) {
    const std::string why = zip_strerror(archive);
    zip_discard(archive);
    fail(Status::memory, "no archive can be made: {}", why);
  }
  zip_stat_t whole;
  zip_stat_init(&whole);
  if (zip_source_stat(made.get(), &whole) != 0 || zip_source_open(made.get()) != 0)
    fail(Status::internal, "the archive that was made cannot be read");
  std::vector<unsigned char> out(static_cast<std::size_t>(whole.size));
  const zip_int64_t got = zip_source_read(made.get(), out.data(), out.size());
  zip_source_close(made.get());
  if (got != static_cast<zip_int64_t>(out.size())) fail(Status::internal, "the archive that was made is cut off");
  return out;
}

}  // namespace vsplat
