#include "model/io/archive/zip_archive.h"

#include <zip.h>

#include <algorithm>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

constexpr zip_int64_t kMostEntries = 1'000'000;
constexpr std::size_t kLongestName = 1000;

struct EntryCloser {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

struct SourceCloser {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};

// Message of a libzip error; frees the error.
std::string text_of(zip_error_t& error) {
  std::string out = zip_error_strerror(&error);
  zip_error_fini(&error);
  return out;
}

bool is_plain(std::string_view name) {
  if (name.empty() || name.size() > kLongestName || name.front() == '/') return false;
  for (const char c : name)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7f' || c == '\\') return false;
  for (std::size_t at = 0; at <= name.size();) {
    const std::size_t end = std::min(name.find('/', at), name.size());
    const std::string_view part = name.substr(at, end - at);
    if (part == ".." || part == "." || (part.empty() && end != name.size())) return false;
    at = end + 1;
  }
  return true;
}

}  // namespace

void ZipArchive::Closer::operator()(zip* archive) const { zip_discard(archive); }

ZipArchive::ZipArchive(const std::string& path) : path_(path) {
  auto file = open_regular(path);
  const std::optional<sys::FileFacts> whole = sys::facts_of(file.get());
  if (!whole) fail(Status::file, "{}: cannot be examined", path);
  zip_error_t error;
  zip_error_init(&error);
  std::unique_ptr<zip_source_t, SourceCloser> source(zip_source_filep_create(file.get(), 0, -1, &error));
  if (!source) fail(Status::file, "{}: cannot be read: {}", path, text_of(error));
  static_cast<void>(file.release());  // now owned by the source
  // Without ZIP_CHECKCONS, for which libzip 1.12.1 takes what torch.save writes for inconsistent.
  archive_.reset(zip_open_from_source(source.get(), ZIP_RDONLY, &error));
  if (!archive_)
    fail(Status::format, "{}: not a zip archive as torch.save writes it, or a damaged one: {}", path, text_of(error));
  static_cast<void>(source.release());  // now owned by the archive
  zip_error_fini(&error);
  const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
  if (count > kMostEntries)
    fail(Status::format, "{}: {} entries in its archive, at most {} are expected", path, count, kMostEntries);
  std::uint64_t left = whole->size;
  for (zip_int64_t i = 0; i < count; ++i) left -= add(static_cast<std::uint64_t>(i), left);
}

ZipArchive::~ZipArchive() = default;

std::uint64_t ZipArchive::add(std::uint64_t index, std::uint64_t left) {
  zip_stat_t found;
  zip_stat_init(&found);
  constexpr zip_uint64_t needed = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_COMP_METHOD;
  if (zip_stat_index(archive_.get(), index, ZIP_FL_ENC_RAW, &found) != 0 || (found.valid & needed) != needed)
    fail(Status::format, "{}: entry {} of its archive cannot be examined: {}", path_, index,
         zip_strerror(archive_.get()));
  const std::string name = found.name;
  if (!is_plain(name))
    fail(Status::format, "{}: its archive has an entry \"{}\": plain names in one folder are expected", path_,
         printable(name));
  if ((found.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && found.encryption_method != ZIP_EM_NONE)
    fail(Status::format, "{}: entry {} of its archive is encrypted", path_, printable(name));
  if (found.comp_method != ZIP_CM_STORE || found.size != found.comp_size)
    fail(Status::format, "{}: entry {} of its archive is compressed, which torch.save does not do ({} bytes in {})",
         path_, printable(name), found.size, found.comp_size);
  if (found.size > left)
    fail(Status::format, "{}: the entries of its archive are larger than the file: it is cut off, or they overlap",
         path_);
  if (!entries_.emplace(name, Entry{index, found.size}).second)
    fail(Status::format, "{}: entry {} is twice in its archive", path_, printable(name));
  return found.size;
}

template <class Take>
void ZipArchive::read_all(const std::string& name, const Entry& entry, std::size_t piece, Take take) const {
  const std::unique_ptr<zip_file_t, EntryCloser> file(zip_fopen_index(archive_.get(), entry.index, 0));
  if (!file)
    fail(Status::format, "{}: entry {} of its archive cannot be read: {}", path_, printable(name),
         zip_strerror(archive_.get()));
  std::uint64_t done = 0;
  for (;;) {  // libzip compares the checksum once the end has been read
    unsigned char* to = take(done, piece);
    const zip_int64_t got = zip_fread(file.get(), to, piece);
    if (got == 0) break;
    if (got < 0)
      fail(Status::format, "{}: entry {} of its archive is damaged or cut off: {}", path_, printable(name),
           zip_file_strerror(file.get()));
    done += static_cast<std::uint64_t>(got);
  }
  if (done != entry.bytes)
    fail(Status::format, "{}: entry {} of its archive has {} bytes, its list says {}", path_, printable(name), done,
         entry.bytes);
}

std::vector<unsigned char> ZipArchive::read(const std::string& name, const Entry& entry) const try {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  std::vector<unsigned char> out;
  out.reserve(static_cast<std::size_t>(entry.bytes) + kPiece);
  read_all(name, entry, kPiece, [&](std::uint64_t done, std::size_t piece) {
    out.resize(static_cast<std::size_t>(done) + piece);
    return out.data() + done;
  });
  out.resize(static_cast<std::size_t>(entry.bytes));
  return out;
} catch (const std::bad_alloc&) {
  fail(Status::memory, "{}: not enough host memory for the {} bytes of {}", path_, entry.bytes, printable(name));
}

void ZipArchive::verify(const std::string& name, const Entry& entry) const {
  std::vector<unsigned char> piece(std::size_t{1} << 20);
  read_all(name, entry, piece.size(), [&](std::uint64_t, std::size_t) { return piece.data(); });
}

}  // namespace vsplat
