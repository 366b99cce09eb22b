#include <png.h>

#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <utility>

#include "model/io/picture/exif.h"
#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

constexpr unsigned char signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};

// Deflate packs at most 1032 bytes into one. A file whose header claims more than that is cut off or damaged, and is
// refused before memory is allocated for it.
constexpr double max_deflate_ratio = 1032.0;

struct Source {
  const unsigned char* data;
  std::size_t size, at;
  char message[160];  // the error that ended decoding
};

void png_problem(png_structp png, png_const_charp text) {
  auto* source = static_cast<Source*>(png_get_error_ptr(png));
  std::strncpy(source->message, text, sizeof source->message - 1);
  longjmp(png_jmpbuf(png), 1);
}

void png_ignore_warning(png_structp, png_const_charp) {}

void png_take(png_structp png, png_bytep out, std::size_t count) {
  auto* source = static_cast<Source*>(png_get_io_ptr(png));
  if (count > source->size - source->at) png_error(png, "the file ends early");
  std::memcpy(out, source->data + source->at, count);
  source->at += count;
}

// libpng exits by longjmp, so objects with destructors live outside the functions that call it.
struct Reader {
  png_structp png = nullptr;
  png_infop info = nullptr;
  Source source;

  explicit Reader(const FileBytes& file) : source{file.data, file.size, 0, {}} {
    png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, png_problem, png_ignore_warning);
    info = png ? png_create_info_struct(png) : nullptr;
    if (!info) {
      png_destroy_read_struct(&png, nullptr, nullptr);
      fail(Status::memory, "{}: not enough memory to decode the picture", file.path);
    }
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() { png_destroy_read_struct(&png, &info, nullptr); }
};

struct Header {
  png_uint_32 width, height;
  int depth, colour_type, interlace;
};

bool read_header(Reader& r, Header& out) {
  if (setjmp(png_jmpbuf(r.png))) return false;
  png_set_user_limits(r.png, 0x7fffffff, 0x7fffffff);
  png_set_crc_action(r.png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  png_set_read_fn(r.png, &r.source, png_take);
  png_read_info(r.png, r.info);
  png_get_IHDR(r.png, r.info, &out.width, &out.height, &out.depth, &out.colour_type, &out.interlace, nullptr, nullptr);
  return true;
}

// Sets the transforms to 8 or 16 bits of grey, grey + alpha, RGB or RGBA. Rows then hold `channels` values in native
// byte order.
bool set_transforms(Reader& r, int& channels, int& depth, int& passes) {
  if (setjmp(png_jmpbuf(r.png))) return false;
  png_set_expand(r.png);  // palette to RGB, 1, 2 and 4 bits to 8, tRNS to alpha
  if (std::endian::native == std::endian::little) png_set_swap(r.png);
  passes = png_set_interlace_handling(r.png);
  png_read_update_info(r.png, r.info);
  channels = png_get_channels(r.png, r.info);
  depth = png_get_bit_depth(r.png, r.info);
  return true;
}

bool read_row(Reader& r, unsigned char* row) {
  if (setjmp(png_jmpbuf(r.png))) return false;
  png_read_row(r.png, row, nullptr);
  return true;
}

// Reads up to IEND, to detect a file that ends within its last chunks.
bool read_end(Reader& r) {
  if (setjmp(png_jmpbuf(r.png))) return false;
  png_read_end(r.png, nullptr);
  return true;
}

[[noreturn]] void damaged(const FileBytes& file, const Reader& r) {
  fail(Status::format, "{}: a damaged or cut-off PNG: {}", file.path, r.source.message);
}

float value(const unsigned char* row, std::size_t i, int depth) {
  if (depth == 8) return static_cast<float>(row[i]) / 255.0f;
  std::uint16_t v;
  std::memcpy(&v, row + 2 * i, sizeof v);
  return static_cast<float>(v) / 65535.0f;
}

void take_row(float* out, const unsigned char* row, int width, int channels, int depth) {
  const int colours = channels <= 2 ? 1 : 3;
  for (int x = 0; x < width; ++x) {
    const std::size_t i = static_cast<std::size_t>(x) * channels;
    for (int c = 0; c < 3; ++c) *out++ = value(row, i + (colours == 3 ? c : 0), depth);
    if (channels > colours) *out++ = value(row, i + colours, depth);
  }
}

// libpng allocates memory for whatever size a chunk claims. Picture data (IDAT) are read in pieces and may be cut off
// here.
void check_chunks(const FileBytes& file) {
  constexpr std::size_t head = 8, tail = 4;
  for (std::size_t at = sizeof signature; file.size - at >= head;) {
    png_uint_32 length;
    std::memcpy(&length, file.data + at, 4);
    length = __builtin_bswap32(length);
    const std::string_view type(reinterpret_cast<const char*>(file.data) + at + 4, 4);
    const std::size_t left = file.size - at - head;
    if (length > left && type != "IDAT")
      fail(Status::format, "{}: a damaged or cut-off PNG: its chunk {} claims {} bytes, {} follow", file.path,
           printable(type), length, left);
    if (length > left || left - length < tail || type == "IEND") return;
    at += head + length + tail;
  }
}

Header checked_header(const FileBytes& file, Reader& r) {
  check_chunks(file);
  Header h{};
  if (!read_header(r, h)) damaged(file, r);
  check_image_size(file.path, h.width, h.height);
  return h;
}

ImageInfo info_of(Reader& r, const Header& h, int channels, int depth, int passes) {
  png_uint_32 size = 0;
  png_bytep data = nullptr;  // if it precedes the picture data
  const bool has_exif = png_get_eXIf_1(r.png, r.info, &size, &data) != 0;
  const ExifFacts exif = has_exif ? read_exif(data, size) : ExifFacts{};
  const double all = static_cast<double>(h.width) * h.height * channels * depth / 8;
  return {static_cast<int>(h.width), static_cast<int>(h.height), channels % 2 == 0,
          exif.orientation,          passes > 1 ? all : 0,       exif.lens};
}

class PngRows : public FileRows {
 public:
  // `reader` has read the header. A row has `stored` channels of `depth` bits; `passes` counts interlace passes.
  PngRows(const FileBytes& file, std::unique_ptr<Reader> reader, const ImageInfo& info, int stored, int depth,
          int passes)
      : FileRows(info, depth), file_(file), reader_(std::move(reader)), stored_(stored), depth_(depth) {
    const std::size_t row = static_cast<std::size_t>(width) * stored * (depth / 8);
    // Interlaced files visit each row several times and need all rows; other files are read row by row.
    if (passes > 1) {
      held_ = memory_to_decode(file, info);
      step_ = row;
    }
    rows_.resize(passes > 1 ? row * height : row);
    for (int pass = 0; pass + 1 < passes; ++pass)
      for (int y = 0; y < height; ++y)
        if (!read_row(*reader_, rows_.data() + row * y)) damaged(file_, *reader_);
  }

  void next(float* out) override {
    unsigned char* row = rows_.data() + step_ * at_;
    if (!read_row(*reader_, row)) damaged(file_, *reader_);
    take_row(out, row, width, stored_, depth_);
    if (++at_ == height && !read_end(*reader_)) damaged(file_, *reader_);
  }

 private:
  const FileBytes file_;
  std::unique_ptr<Reader> reader_;
  int stored_, depth_, at_ = 0;
  std::size_t step_ = 0;  // bytes between rows
  std::vector<unsigned char> rows_;
  DecodingMemory held_;
};

void png_append(png_structp png, png_bytep data, std::size_t size) {
  auto* out = static_cast<std::vector<unsigned char>*>(png_get_io_ptr(png));
  out->insert(out->end(), data, data + size);
}

void png_no_flush(png_structp) {}

int colour_type_of(int channels) {
  if (channels == 4) return PNG_COLOR_TYPE_RGB_ALPHA;
  return channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY;
}

// The caller owns `rows` and `out`, so no object here has a destructor.
bool write_all(png_structp png, png_infop info, int width, int height, int channels, int bits,
               const unsigned char* rows, std::vector<unsigned char>& out) {
  if (setjmp(png_jmpbuf(png))) return false;
  png_set_write_fn(png, &out, png_append, png_no_flush);
  png_set_user_limits(png, 0x7fffffff, 0x7fffffff);
  png_set_IHDR(png, info, width, height, bits, colour_type_of(channels), PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  const std::size_t row = static_cast<std::size_t>(width) * channels * bits / 8;
  for (int y = 0; y < height; ++y) png_write_row(png, rows + static_cast<std::size_t>(y) * row);
  png_write_end(png, nullptr);
  return true;
}

std::vector<unsigned char> encoded(const Image& image, int bits, const std::vector<unsigned char>& rows) {
  Source source{};
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &source, png_problem, png_ignore_warning);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  std::vector<unsigned char> out;
  const bool good = info && write_all(png, info, image.width, image.height, image.channels, bits, rows.data(), out);
  png_destroy_write_struct(&png, &info);
  if (!good) fail(Status::internal, "PNG encoding failed: {}", source.message);
  return out;
}

}  // namespace

bool is_png(const FileBytes& file) {
  return file.size >= sizeof signature && std::memcmp(file.data, signature, sizeof signature) == 0;
}

ImageInfo png_info(const FileBytes& file) {
  Reader r(file);
  const Header h = checked_header(file, r);
  int channels = 0, depth = 0, passes = 0;
  if (!set_transforms(r, channels, depth, passes)) damaged(file, r);
  return info_of(r, h, channels, depth, passes);
}

std::unique_ptr<FileRows> open_png(const FileBytes& file) {
  auto reader = std::make_unique<Reader>(file);
  Reader& r = *reader;
  const Header h = checked_header(file, r);
  const double stored_bits = static_cast<double>(h.width) * h.height * h.depth * png_get_channels(r.png, r.info);
  if (stored_bits / 8 > max_deflate_ratio * static_cast<double>(file.size))
    fail(Status::format, "{}: a damaged or cut-off PNG: {} bytes cannot hold its {} x {} pixels", file.path, file.size,
         h.width, h.height);
  int channels = 0, depth = 0, passes = 0;
  if (!set_transforms(r, channels, depth, passes)) damaged(file, r);
  return std::make_unique<PngRows>(file, std::move(reader), info_of(r, h, channels, depth, passes), channels, depth,
                                   passes);
}

std::vector<unsigned char> encode_png(const Image& image) {
  if ((image.channels != 1 && image.channels != 3 && image.channels != 4) || image.empty())
    fail(Status::internal, "write_png takes 1, 3 or 4 channels, not {} x {} x {}", image.width, image.height,
         image.channels);
  return encoded(image, 8, rounded(image));
}

std::vector<unsigned char> encode_png_16(const Image& image) {
  if (image.channels != 1 || image.empty())
    fail(Status::internal, "a PNG of 16 bits takes 1 channel, not {} x {} x {}", image.width, image.height,
         image.channels);
  std::vector<unsigned char> rows;
  rows.reserve(2 * image.data.size());
  for (const float v : image.data) {
    const auto value = static_cast<unsigned>(v > 0 ? std::lround(std::fmin(v, 65535.0f)) : 0);
    rows.push_back(static_cast<unsigned char>(value >> 8));  // the high byte first
    rows.push_back(static_cast<unsigned char>(value & 255));
  }
  return encoded(image, 16, rows);
}

}  // namespace vsplat
