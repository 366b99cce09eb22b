#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

// A file in memory, and the first error that libtiff reports for it.
struct Source {
  const unsigned char* data;
  toff_t size, at = 0;
  char message[160] = {};
};

Source& source_of(thandle_t handle) { return *static_cast<Source*>(handle); }

tmsize_t take(thandle_t handle, void* out, tmsize_t count) {
  Source& s = source_of(handle);
  const toff_t left = s.at < s.size ? s.size - s.at : 0;
  const auto taken = static_cast<tmsize_t>(std::min<toff_t>(left, static_cast<toff_t>(std::max<tmsize_t>(count, 0))));
  if (taken > 0) std::memcpy(out, s.data + s.at, static_cast<std::size_t>(taken));
  s.at += static_cast<toff_t>(taken);
  return taken;
}

tmsize_t write_nothing(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek(thandle_t handle, toff_t offset, int from) {
  Source& s = source_of(handle);
  s.at = offset + (from == SEEK_CUR ? s.at : from == SEEK_END ? s.size : 0);
  return s.at;
}

int close_nothing(thandle_t) { return 0; }

toff_t size_of(thandle_t handle) { return source_of(handle).size; }

// libtiff 4.5 reads uncompressed tiles wrongly from unmapped files. It does not write to the mapping.
int map(thandle_t handle, void** base, toff_t* size) {
  *base = const_cast<unsigned char*>(source_of(handle).data);
  *size = source_of(handle).size;
  return 1;
}
void unmap(thandle_t, void*, toff_t) {}

int keep_error(TIFF*, void* user, const char*, const char* format, va_list arguments) {
  Source& s = *static_cast<Source*>(user);
  if (s.message[0] == 0) std::vsnprintf(s.message, sizeof s.message, format, arguments);
  return 1;  // print nothing
}

int ignore_warning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

// Limit on the bytes of host memory that decoding may hold: with the program at most 1.5 GiB.
constexpr double most_held = 1.25 * (1u << 30);
// Limit on the bytes of an unpacked strip or tile for each pixel of the picture: 64 samples of 16 bits. Tiles may reach
// beyond a small picture.
constexpr double most_of_pixel = 128, least_pixels = 1u << 20;

[[noreturn]] void damaged(const FileBytes& file, const char* why) {
  fail(Status::format, "{}: a damaged or cut-off TIFF, or one of a kind that is not read: {}", file.path,
       *why ? printable(why) : std::string("no reason given"));
}

// The file's first picture, opened.
class Reader {
 public:
  // `most`: limit on the bytes that decoding may hold.
  Reader(const FileBytes& file, double most) : file_(file), most_(most), source_{file.data, file.size} {
    const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                               TIFFOpenOptionsFree);
    if (!options) fail(Status::memory, "{}: not enough memory to decode the picture", file.path);
    TIFFOpenOptionsSetErrorHandlerExtR(options.get(), keep_error, &source_);
    TIFFOpenOptionsSetWarningHandlerExtR(options.get(), ignore_warning, nullptr);
    TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), 16 * max_image_pixels);
    tiff_ = TIFFClientOpenExt("picture", "r", &source_, take, write_nothing, seek, close_nothing, size_of, map, unmap,
                              options.get());
    if (!tiff_) damaged(file_, source_.message);
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() {
    if (begun_) TIFFRGBAImageEnd(&image_);
    TIFFClose(tiff_);
  }

  // Checks the kind of picture; reads no pixels.
  ImageInfo begin() {
    std::uint32_t width = 0, height = 0;
    if (!TIFFGetField(tiff_, TIFFTAG_IMAGEWIDTH, &width) || !TIFFGetField(tiff_, TIFFTAG_IMAGELENGTH, &height))
      damaged(file_, "it has no size");
    check_image_size(file_.path, static_cast<long>(width), static_cast<long>(height));
    char why[1024] = {};
    if (!TIFFRGBAImageOK(tiff_, why) || !TIFFRGBAImageBegin(&image_, tiff_, 1, why)) damaged(file_, why);
    begun_ = true;
    int orientation = ORIENTATION_TOPLEFT;
    if (image_.orientation >= 1 && image_.orientation <= 8)
      orientation = image_.orientation;  // EXIF uses TIFF's orientations
    ImageInfo out{static_cast<int>(width), static_cast<int>(height), image_.alpha != 0, orientation};
    if (unpacked_bytes() > most_of_pixel * std::max(static_cast<double>(width) * height, least_pixels))
      damaged(file_, fmt::format("a strip or tile has {:.3g} GiB when unpacked, for {} x {} pixels",
                                 unpacked_bytes() / (1u << 30), width, height)
                         .c_str());
    if (unpacked_bytes() + row_bytes(out) > most_)
      fail(Status::input,
           "{}: a strip or tile of the TIFF has {:.3g} GiB when unpacked, at most {:.3g} GiB are read; write it with "
           "shorter strips",
           file_.path, unpacked_bytes() / (1u << 30), most_ / (1u << 30));
    out.held = unpacked_bytes() + row_bytes(out) * rows_at_once(out);
    return out;
  }

  // The best number of rows to read at once: a strip or a row of tiles, which are unpacked as a whole. If that is too
  // large, each part of it is unpacked again.
  int rows_at_once(const ImageInfo& info) {
    std::uint32_t rows = 0;  // in a strip or in a row of tiles
    if (!TIFFGetField(tiff_, TIFFIsTiled(tiff_) ? TIFFTAG_TILELENGTH : TIFFTAG_ROWSPERSTRIP, &rows) || rows == 0)
      rows = static_cast<std::uint32_t>(info.height);
    const double all = std::min(static_cast<double>(rows), static_cast<double>(info.height));
    const double room = (most_ - unpacked_bytes() - static_cast<double>(file_.size)) / row_bytes(info);
    return static_cast<int>(std::clamp(std::floor(room), std::ceil(all / 8), all));  // at least an eighth: unpacked up
                                                                                     // to 8 times
  }
  static double row_bytes(const ImageInfo& info) { return sizeof(std::uint32_t) * static_cast<double>(info.width); }
  double unpacked_bytes() {
    return static_cast<double>(TIFFIsTiled(tiff_) ? TIFFTileSize64(tiff_) : TIFFStripSize64(tiff_));
  }

  // Rows from `first` on, as stored; red in the lowest byte; premultiplied.
  void read(const ImageInfo& info, int first, int count, std::uint32_t* out) {
    image_.orientation = image_.req_orientation = ORIENTATION_TOPLEFT;
    image_.row_offset = first;
    if (!TIFFRGBAImageGet(&image_, out, static_cast<std::uint32_t>(info.width), static_cast<std::uint32_t>(count)))
      damaged(file_, source_.message);
  }

 private:
  const FileBytes file_;
  const double most_;
  Source source_;
  TIFF* tiff_ = nullptr;
  TIFFRGBAImage image_{};
  bool begun_ = false;
};

class TiffRows : public FileRows {
 public:
  TiffRows(const FileBytes& file, std::unique_ptr<Reader> reader, const ImageInfo& info)
      : FileRows(info, info.alpha ? 32 : 8),
        reader_(std::move(reader)),
        info_(info),
        most_(reader_->rows_at_once(info)) {
    held_ = memory_to_decode(file, info);
    band_.resize(static_cast<std::size_t>(most_) * width);
  }

  void next(float* to) override {
    if (at_ % most_ == 0) reader_->read(info_, at_, std::min(most_, height - at_), band_.data());
    const std::uint32_t* from = band_.data() + static_cast<std::size_t>(at_++ % most_) * width;
    for (int x = 0; x < width; ++x) {
      const std::uint32_t pixel = *from++;
      const unsigned alpha = TIFFGetA(pixel);
      const unsigned colour[] = {TIFFGetR(pixel), TIFFGetG(pixel), TIFFGetB(pixel)};
      const unsigned whole = info_.alpha ? alpha : 255;
      for (const unsigned c : colour)
        *to++ = whole == 0 ? 0.0f : std::min(1.0f, static_cast<float>(c) / static_cast<float>(whole));
      if (info_.alpha) *to++ = static_cast<float>(alpha) / 255.0f;
    }
  }

 private:
  std::unique_ptr<Reader> reader_;
  ImageInfo info_;
  int most_, at_ = 0;
  std::vector<std::uint32_t> band_;
  DecodingMemory held_;
};

}  // namespace

bool is_tiff(const FileBytes& file) {
  if (file.size < 4) return false;
  for (const char* magic : {"II*\0", "MM\0*", "II+\0", "MM\0+"})
    if (std::memcmp(file.data, magic, 4) == 0) return true;
  return false;
}

ImageInfo tiff_info(const FileBytes& file) { return Reader(file, most_held).begin(); }

std::unique_ptr<FileRows> open_tiff(const FileBytes& file) { return open_tiff_within(file, most_held); }

std::unique_ptr<FileRows> open_tiff_within(const FileBytes& file, double most) {
  auto reader = std::make_unique<Reader>(file, most);
  const ImageInfo info = reader->begin();
  return std::make_unique<TiffRows>(file, std::move(reader), info);
}

}  // namespace vsplat
