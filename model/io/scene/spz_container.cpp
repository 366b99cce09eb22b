#include "model/io/scene/spz_container.h"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <future>
#include <memory>

#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

constexpr std::uint32_t kSpzMagic = 0x5053474e;  // "NGSP"
constexpr std::size_t kSpzOldHeader = 16, kSpzHeader = 32, kSpzEntry = 16;
constexpr std::uint8_t kAntialias = 1, kExtensions = 2;
constexpr std::uint32_t kFrameExtension = 0xADBE0003u;
constexpr std::uint64_t kFewBytes = std::uint64_t{64} << 20;  // decompressed bytes that any file may have
constexpr std::uint64_t kMostRatio = 1024;                    // decompressed bytes for each byte of a file
constexpr const char* kStreamNames[] = {"positions", "alphas", "colors", "scales", "rotations", "spherical harmonics"};

template <class T>
T number_at(const std::byte* at) {
  T out;
  std::memcpy(&out, at, sizeof out);
  return out;
}

template <class T>
void put_number(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// Reads the fields that both kinds of headers have, and checks them.
SpzContainer read_header(const std::string& name, const std::byte* at, std::uint64_t file_size) {
  SpzContainer out;
  const auto magic = number_at<std::uint32_t>(at), version = number_at<std::uint32_t>(at + 4);
  if (magic != kSpzMagic) fail(Status::format, "{}: byte 0 of its SPZ header: {:#x}, NGSP is expected", name, magic);
  if (version < kSpzOldest || version > kSpzNewest)
    fail(Status::format, "{}: version (byte 4 of its SPZ header): {}, {} to {} are read", name, version, kSpzOldest,
         kSpzNewest);
  out.version = static_cast<int>(version);
  out.count = number_at<std::uint32_t>(at + 8);
  out.degree = number_at<std::uint8_t>(at + 12);
  out.bits = number_at<std::uint8_t>(at + 13);
  out.antialias = (number_at<std::uint8_t>(at + 14) & kAntialias) != 0;
  if (out.degree > kSpzMostDegree)
    fail(Status::format, "{}: SH degree (byte 12 of its SPZ header): {}, 0 to {} are expected", name, out.degree,
         kSpzMostDegree);
  if (out.bits > kSpzMostBits)
    fail(Status::format, "{}: fractional bits (byte 13 of its SPZ header): {}, 0 to {} are expected", name, out.bits,
         kSpzMostBits);
  std::uint64_t all = 0;
  for (std::size_t s = 0; s < kSpzStreams; ++s) all += out.count * static_cast<std::uint64_t>(out.bytes_of(s));
  if (out.count == 0 || out.count > INT32_MAX || all > std::max(kFewBytes, kMostRatio * file_size))
    fail(Status::format, "{}: count (byte 8 of its SPZ header): {} Gaussians, which no file of {} bytes holds", name,
         out.count, file_size);
  const double floats = 11.0 + 3.0 * static_cast<double>(out.coefficients() + 1);
  out.reserved = HostMemory(name + ": its Gaussians", static_cast<double>(all) + 4 * floats * out.count);
  return out;
}

// Extension records: a type, a length, a payload.
void read_extensions(const std::string& name, std::span<const std::byte> records, SpzContainer& out) {
  for (std::size_t at = 0; at < records.size();) {
    if (records.size() - at < 8 || number_at<std::uint32_t>(&records[at + 4]) > records.size() - at - 8)
      fail(Status::format, "{}: extension record (byte {} of the records): it is cut off", name, at);
    const auto type = number_at<std::uint32_t>(&records[at]), size = number_at<std::uint32_t>(&records[at + 4]);
    if (type == kFrameExtension) {
      if (size < 4)
        fail(Status::format, "{}: extension of the coordinate system: {} bytes, 4 are expected", name, size);
      out.frame = number_at<std::uint32_t>(&records[at + 8]);
      if (out.frame < 1 || out.frame > 8)
        fail(Status::format, "{}: coordinate system {} in its extension: 1 to 8 are read, which need no swap of axes",
             name, out.frame);
    }
    at += 8 + size;
  }
}

// A gzip stream, decompressed piece by piece.
class Inflater {
 public:
  Inflater(const std::string& name, std::span<const std::byte> content) : name_(name), content_(content) {
    if (inflateInit2(&stream_, 16 + MAX_WBITS) != Z_OK) fail(Status::memory, "{}: zlib cannot be started", name);
    // Files beyond 4 GiB would hold hundreds of millions of Gaussians.
    if (content.size() > UINT32_MAX) fail(Status::format, "{}: {} bytes of gzip: too large", name, content.size());
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(content.data()));
    stream_.avail_in = static_cast<uInt>(content.size());
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  // Returns fewer bytes only at the end of the stream.
  std::size_t read(void* to, std::size_t bytes) {
    std::size_t got = 0;
    while (got < bytes && !ended_) {
      const std::size_t piece = std::min<std::size_t>(bytes - got, 1u << 30);
      stream_.next_out = static_cast<Bytef*>(to) + got;
      stream_.avail_out = static_cast<uInt>(piece);
      const int result = inflate(&stream_, Z_NO_FLUSH);
      got += piece - stream_.avail_out;
      if (result == Z_STREAM_END)
        ended_ = true;
      else if (result != Z_OK)
        fail(Status::format, "{}: its gzip data (byte {}) are cut off or damaged", name_,
             content_.size() - stream_.avail_in);
    }
    return got;
  }

 private:
  const std::string& name_;
  std::span<const std::byte> content_;
  z_stream stream_{};
  bool ended_ = false;
};

SpzContainer unpack_gzip(const std::string& name, std::span<const std::byte> content) {
  Inflater in(name, content);
  std::array<std::byte, kSpzOldHeader> header{};
  if (const std::size_t got = in.read(header.data(), header.size()); got != header.size())
    fail(Status::format, "{}: {} bytes in its gzip data: an SPZ header has {}; unpack other files with gunzip", name,
         got, header.size());
  if (number_at<std::uint32_t>(header.data()) != kSpzMagic)
    fail(Status::format, "{}: byte 0 of its gzip data begins {:#x}, not NGSP as in an SPZ scene: unpack it with gunzip",
         name, number_at<std::uint32_t>(header.data()));
  SpzContainer out = read_header(name, header.data(), content.size());
  if (out.version == kSpzNewest)
    fail(Status::format, "{}: version 4 (byte 4 of its SPZ header) in gzip data: 1 to 3 are expected there", name);
  std::uint64_t at = kSpzOldHeader;
  for (std::size_t s = 0; s < kSpzStreams; ++s) {
    std::vector<std::uint8_t>& stream = out.streams[s];
    const std::uint64_t size = out.count * static_cast<std::uint64_t>(out.bytes_of(s));
    stream.resize(static_cast<std::size_t>(size));
    if (const std::size_t got = in.read(stream.data(), stream.size()); got != stream.size())
      fail(Status::format,
           "{}: {}: {} bytes expected from byte {} of the decompressed data on, {} are there: it is cut off", name,
           kStreamNames[s], size, at, got);
    at += size;
  }
  std::array<std::byte, 4096> rest{};
  const std::size_t more = in.read(rest.data(), rest.size());
  if (std::to_integer<std::uint8_t>(header[14]) & kExtensions)
    read_extensions(name, std::span(rest).first(more), out);
  else if (more)
    warn("{}: bytes after the last Gaussian are ignored (from byte {} of the decompressed data on)", name, at);
  return out;
}

void decompress_zstd(const std::string& name, std::span<const std::byte> from, std::vector<std::uint8_t>& to,
                     const char* what, std::uint64_t at) {
  const std::size_t got = ZSTD_decompress(to.data(), to.size(), from.data(), from.size());
  if (ZSTD_isError(got))
    fail(Status::format, "{}: {} (byte {}): its zstd data are damaged: {}", name, what, at, ZSTD_getErrorName(got));
  if (got != to.size())
    fail(Status::format, "{}: {} (byte {}): {} bytes decompressed, {} are expected", name, what, at, got, to.size());
}

SpzContainer unpack_zstd(const std::string& name, std::span<const std::byte> content) {
  if (content.size() < kSpzHeader)
    fail(Status::format, "{}: {} bytes: an SPZ header has {}", name, content.size(), kSpzHeader);
  SpzContainer out = read_header(name, content.data(), content.size());
  if (out.version != kSpzNewest)
    fail(Status::format, "{}: version {} (byte 4) without gzip: {} is expected there", name, out.version, kSpzNewest);
  const std::size_t num_streams = std::to_integer<std::size_t>(content[15]), expected = out.degree ? 6 : 5;
  const std::size_t table = number_at<std::uint32_t>(&content[16]);
  if (num_streams != expected)
    fail(Status::format, "{}: streams (byte 15): {}, {} are expected for SH degree {}", name, num_streams, expected,
         out.degree);
  if (table < kSpzHeader || table > content.size() || content.size() - table < num_streams * kSpzEntry)
    fail(Status::format, "{}: table of contents (byte 16): at byte {} with {} entries, the file has {} bytes", name,
         table, num_streams, content.size());
  if (std::to_integer<std::uint8_t>(content[14]) & kExtensions)
    read_extensions(name, content.subspan(kSpzHeader, table - kSpzHeader), out);
  std::uint64_t at = table + num_streams * kSpzEntry;
  struct Place {
    std::uint64_t at, size;
  };
  std::array<Place, kSpzStreams> places{};
  for (std::size_t s = 0; s < num_streams; ++s) {
    const std::size_t entry = table + s * kSpzEntry;
    const auto packed = number_at<std::uint64_t>(&content[entry]), size = number_at<std::uint64_t>(&content[entry + 8]);
    const std::uint64_t needed = out.count * static_cast<std::uint64_t>(out.bytes_of(s));
    if (packed > content.size() - at)
      fail(Status::format, "{}: {}: {} bytes from byte {} on (byte {}), the file has {}: it is cut off", name,
           kStreamNames[s], packed, at, entry, content.size());
    if (size != needed)
      fail(Status::format, "{}: {}: {} bytes decompressed (byte {}), {} Gaussians need {}", name, kStreamNames[s], size,
           entry + 8, out.count, needed);
    places[s] = {at, packed};
    at += packed;
  }
  if (at != content.size())
    warn("{}: {} bytes after the last stream are ignored (from byte {} on)", name, content.size() - at, at);
  std::vector<std::future<void>> running;
  for (std::size_t s = 0; s < num_streams; ++s) {
    const std::size_t size = out.count * out.bytes_of(s);
    out.streams[s].resize(size);
    running.push_back(std::async(std::launch::async, [&, s] {
      decompress_zstd(name,
                      content.subspan(static_cast<std::size_t>(places[s].at), static_cast<std::size_t>(places[s].size)),
                      out.streams[s], kStreamNames[s], places[s].at);
    }));
  }
  for (std::future<void>& each : running) each.wait();
  for (std::future<void>& each : running) each.get();
  return out;
}

std::string header_of(const SpzContainer& spz) {
  std::string out;
  put_number(out, kSpzMagic);
  put_number(out, static_cast<std::uint32_t>(spz.version));
  put_number(out, spz.count);
  put_number(out, static_cast<std::uint8_t>(spz.degree));
  put_number(out, static_cast<std::uint8_t>(spz.bits));
  put_number(out, spz.antialias ? kAntialias : std::uint8_t{0});
  return out;
}

std::string pack_gzip(const SpzContainer& spz) {
  std::string out;
  std::string header = header_of(spz);
  put_number(header, std::uint8_t{0});
  z_stream stream{};
  if (deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, 16 + MAX_WBITS, 9, Z_DEFAULT_STRATEGY) != Z_OK)
    fail(Status::memory, "zlib cannot be started");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> ending(&stream, deflateEnd);
  std::vector<char> buffer(1 << 18);
  const auto add = [&](const void* from, std::size_t size, int flush) {
    stream.next_in = static_cast<Bytef*>(const_cast<void*>(from));
    for (std::size_t left = size;;) {
      if (stream.avail_in == 0 && left > 0) {
        stream.avail_in = static_cast<uInt>(std::min<std::size_t>(left, 1u << 30));
        left -= stream.avail_in;
      }
      stream.next_out = reinterpret_cast<Bytef*>(buffer.data());
      stream.avail_out = static_cast<uInt>(buffer.size());
      const int result = deflate(&stream, left == 0 ? flush : Z_NO_FLUSH);
      out.append(buffer.data(), buffer.size() - stream.avail_out);
      if (result == Z_STREAM_END || (stream.avail_in == 0 && left == 0 && flush == Z_NO_FLUSH && stream.avail_out != 0))
        return;
    }
  };
  add(header.data(), header.size(), Z_NO_FLUSH);
  for (const std::vector<std::uint8_t>& each : spz.streams) add(each.data(), each.size(), Z_NO_FLUSH);
  add(nullptr, 0, Z_FINISH);
  return out;
}

std::string compress_zstd(const std::vector<std::uint8_t>& from) {
  constexpr int level = 1;  // higher ones take up to 20 times as long for at most 1 % of the size
  std::string out(ZSTD_compressBound(from.size()), '\0');
  const std::size_t size = ZSTD_compress(out.data(), out.size(), from.data(), from.size(), level);
  if (ZSTD_isError(size)) fail(Status::memory, "zstd: {}", ZSTD_getErrorName(size));
  out.resize(size);
  return out;
}

std::string pack_zstd(const SpzContainer& spz) {
  std::vector<std::future<std::string>> running;
  for (const std::vector<std::uint8_t>& stream : spz.streams)
    if (!stream.empty()) running.push_back(std::async(std::launch::async, [&stream] { return compress_zstd(stream); }));
  std::string out = header_of(spz);
  put_number(out, static_cast<std::uint8_t>(running.size()));
  put_number(out, static_cast<std::uint32_t>(kSpzHeader));
  out.resize(kSpzHeader, '\0');
  std::vector<std::string> packed;
  packed.reserve(running.size());
  for (std::future<std::string>& each : running) packed.push_back(each.get());
  std::size_t i = 0;
  for (const std::vector<std::uint8_t>& stream : spz.streams) {
    if (stream.empty()) continue;
    put_number(out, static_cast<std::uint64_t>(packed[i++].size()));
    put_number(out, static_cast<std::uint64_t>(stream.size()));
  }
  for (const std::string& each : packed) out += each;
  return out;
}

}  // namespace

std::size_t SpzContainer::bytes_of(std::size_t stream) const {
  switch (stream) {
    case kSpzPositions:
      return version == 1 ? 6 : 9;
    case kSpzAlphas:
      return 1;
    case kSpzRotations:
      return version < 3 ? 3 : 4;
    case kSpzSh:
      return 3 * coefficients();
    default:
      return 3;
  }
}

static bool is_gzip(std::span<const std::byte> content) {
  return content.size() >= 2 && content[0] == std::byte{0x1f} && content[1] == std::byte{0x8b};
}

SpzBeginning spz_beginning(const std::string& name, std::span<const std::byte> content) {
  std::array<std::byte, kSpzOldHeader> header{};
  if (is_gzip(content))
    Inflater(name, content).read(header.data(), header.size());
  else
    std::copy_n(content.begin(), std::min(content.size(), header.size()), header.begin());
  return {number_at<std::uint32_t>(&header[4]), (std::to_integer<std::uint8_t>(header[14]) & kExtensions) != 0};
}

SpzContainer unpack_spz(const std::string& name, std::span<const std::byte> content) {
  return is_gzip(content) ? unpack_gzip(name, content) : unpack_zstd(name, content);
}

std::string pack_spz(const SpzContainer& spz) { return spz.version < kSpzNewest ? pack_gzip(spz) : pack_zstd(spz); }

}  // namespace vsplat
