#include <ImfChannelList.h>
#if __has_include(<ImfContextInit.h>)
#include <ImfContextInit.h>
#define VSPLAT_OPENEXR_CONTEXT 1
#endif
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <stdexcept>
#include <utility>

#include "model/io/picture/exr_channels.h"
#include "model/io/picture/exr_header.h"
#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(const FileBytes& file) : IStream(file.path.c_str()), data_(file.data), size_(file.size) {}

  bool read(char* out, int count) override {
    if (count < 0 || static_cast<std::size_t>(count) > size_ - at_) throw std::runtime_error("the file ends early");
    std::memcpy(out, data_ + at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
    return at_ < size_;
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t position) override {
    if (position > size_) throw std::runtime_error("the file ends early");
    at_ = position;
  }

 private:
  const unsigned char* data_;
  std::size_t size_, at_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : OStream("memory") {}

  void write(const char* from, int count) override {
    const std::size_t n = static_cast<std::size_t>(count);
    if (at_ + n > bytes.size()) bytes.resize(at_ + n);
    std::memcpy(bytes.data() + at_, from, n);
    at_ += n;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }

  std::vector<unsigned char> bytes;

 private:
  std::size_t at_ = 0;
};

struct Window {
  long x0, y0, width, height;
};

Window window_of(const Imath::Box2i& box) {
  return {box.min.x, box.min.y, static_cast<long>(box.max.x) - box.min.x + 1,
          static_cast<long>(box.max.y) - box.min.y + 1};
}

// Refuses a header that claims more than the file can hold, before memory is allocated for it. No codec except DWA
// packs a run of equal samples more than 2048 times (deflate's limit is 1032).
void check_plausible(const FileBytes& file, const Imf::Header& header, const Window& data, int channels) {
  if (header.compression() == Imf::DWAA_COMPRESSION || header.compression() == Imf::DWAB_COMPRESSION) return;
  const double least = 2.0 * channels * static_cast<double>(data.width) * static_cast<double>(data.height) / 2048;
  if (least > static_cast<double>(file.size))
    fail(Status::format, "{}: a damaged or cut-off EXR: {} bytes cannot hold its {} x {} pixels", file.path, file.size,
         data.width, data.height);
}

void check_kind(const FileBytes& file, const Imf::Header& header) {
  if (header.hasType() && header.type() != Imf::SCANLINEIMAGE && header.type() != Imf::TILEDIMAGE)
    fail(Status::format, "{}: an EXR of type {}; scanline or tiled is expected", file.path, printable(header.type()));
  const Window display = window_of(header.displayWindow()), data = window_of(header.dataWindow());
  check_image_size(file.path, display.width, display.height);
  check_image_size(file.path, data.width, data.height);
}

// Returns the result of `work`; exceptions of OpenEXR become Error(format).
template <class Work>
auto checked(const FileBytes& file, const Work& work) {
  try {
    return work();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    fail(Status::format, "{}: a damaged or cut-off EXR: {}", file.path, printable(e.what()));
  }
}

constexpr long lines = 256;  // rows read at once: the largest block that any compression uses

// OpenEXR 3.3 and later print what is wrong, beside throwing it, unless a handler takes it.
#ifdef VSPLAT_OPENEXR_CONTEXT
struct Parts : Imf::MultiPartInputFile {
  Parts(const FileBytes& file, Imf::IStream& stream)
      : MultiPartInputFile(file.path.c_str(),
                           Imf::ContextInitializer().setInputStream(&stream).setErrorHandler(
                               [](exr_const_context_t, exr_result_t, const char*) {}),
                           0) {}
};
#else
struct Parts : Imf::MultiPartInputFile {
  Parts(const FileBytes&, Imf::IStream& stream) : MultiPartInputFile(stream, 0) {}
};
#endif

const FileBytes& checked_header(const FileBytes& file) {
  check_exr_header(file);
  return file;
}

// An opened file and the channels to read from it.
struct Opened {
  Opened(const FileBytes& file, bool depth)
      : stream(checked_header(file)),
        parts(file, stream),
        channels(depth ? find_exr_depth(file.path, parts) : find_exr_channels(file.path, parts)),
        is_depth(depth) {
    check_kind(file, header());
  }
  const Imf::Header& header() const { return parts.header(channels.part); }
  ImageInfo info() const {
    const Window display = window_of(header().displayWindow()), data = window_of(header().dataWindow());
    ImageInfo out{static_cast<int>(display.width), static_cast<int>(display.height), !channels.alpha.empty()};
    // Our rows plus the rows that OpenEXR unpacks: equally many, or a row of tiles.
    const double ours = static_cast<double>(std::min(lines, data.height));
    const double tiles = header().hasTileDescription() ? header().tileDescription().ySize : ours;
    out.held = (ours + std::min(tiles, static_cast<double>(data.height))) * static_cast<double>(data.width) *
               (out.alpha ? 4 : 3) * sizeof(float);
    return out;
  }

  MemoryInput stream;
  Parts parts;
  ExrChannels channels;
  bool is_depth;  // values are kept as they are stored
};

float in_unit(float v) {
  return v > 0 ? std::fmin(v, 1.0f) : 0.0f;  // NaN is not > 0
}

// Converts linear, premultiplied to sRGB-encoded, straight alpha.
void to_display(float* pixel, bool alpha) {
  const float a = alpha ? in_unit(pixel[3]) : 1.0f;
  for (int c = 0; c < 3; ++c) pixel[c] = a > 0 ? in_unit(srgb_encode(in_unit(pixel[c] / a))) : 0.0f;
  if (alpha) pixel[3] = a;
}

// The picture is the display window. The data window may be smaller (alpha 0 around it) or larger (cropped).
class ExrRows : public FileRows {
 public:
  ExrRows(const FileBytes& file, std::unique_ptr<Opened> opened)
      : FileRows(opened->info(), 32),
        file_(file),
        opened_(std::move(opened)),
        found_(opened_->channels),
        data_(window_of(opened_->header().dataWindow())),
        display_(window_of(opened_->header().displayWindow())),
        part_(opened_->parts, found_.part) {
    const Imf::Header& header = opened_->header();
    check_exr_channels(file.path, header, found_);
    check_plausible(file, header, data_, (found_.grey() ? 1 : 3) + (has_alpha() ? 1 : 0));
    held_ = memory_to_decode(file, opened_->info());
    band_.resize(static_cast<std::size_t>(std::min(lines, data_.height) * data_.width * channels));
  }

  void next(float* row) override {
    const long y = display_.y0 + at_++;
    std::fill_n(row, row_size(), 0.0f);
    if (y >= data_.y0 && y < data_.y0 + data_.height) {
      if ((y - data_.y0) % lines == 0 || !begun_) read_from(y);
      const long left = std::max(data_.x0, display_.x0),
                 right = std::min(data_.x0 + data_.width, display_.x0 + display_.width);
      const float* from = band_.data() + ((y - data_.y0) % lines * data_.width + left - data_.x0) * channels;
      if (left < right) std::copy_n(from, (right - left) * channels, row + (left - display_.x0) * channels);
    }
    if (at_ < height) return;
    read_below();
    if (!found_.layer.empty()) verbose("{}: its layer \"{}\" is read", file_.path, printable(found_.layer));
    if (odd_ > 0 && !opened_->is_depth)
      warn("{}: {} of its values are not finite: NaN is read as 0, and infinity as the end of the range", file_.path,
           odd_);
  }

 private:
  // Reads the band that contains row `y`; bands are counted from the top of the data window.
  void read_from(long y) {
    begun_ = true;
    const long first = y - (y - data_.y0) % lines, last = std::min(first + lines, data_.y0 + data_.height) - 1;
    const long x0 = data_.x0, step = channels;
    Imf::FrameBuffer buffer;
    const auto slice = [&](const std::string& name, int c) {
      const Imath::Box2i box({static_cast<int>(x0), static_cast<int>(first)},
                             {static_cast<int>(x0 + data_.width - 1), static_cast<int>(last)});
      buffer.insert(name.c_str(), Imf::Slice::Make(Imf::FLOAT, band_.data() + c, box, sizeof(float) * step,
                                                   sizeof(float) * step * data_.width));
    };
    for (std::size_t c = 0; c < found_.colours.size(); ++c) slice(found_.colours[c], static_cast<int>(c));
    if (has_alpha()) slice(found_.alpha, 3);
    checked(file_, [&] {
      part_.setFrameBuffer(buffer);
      part_.readPixels(static_cast<int>(first), static_cast<int>(last));
    });
    const std::size_t count = static_cast<std::size_t>((last - first + 1) * data_.width * channels);
    if (found_.grey())
      for (std::size_t i = 0; i < count; i += channels) band_[i + 1] = band_[i + 2] = band_[i];
    odd_ += std::count_if(band_.begin(), band_.begin() + static_cast<std::ptrdiff_t>(count),
                          [](float v) { return !std::isfinite(v); });
    if (opened_->is_depth) return;
    for (std::size_t i = 0; i < count; i += channels) to_display(&band_[i], has_alpha());
  }

  bool has_alpha() const { return !found_.alpha.empty(); }

  // Reads the rows below the display window, to detect a file that is cut off there.
  void read_below() {
    const long shown = display_.y0 + display_.height, end = data_.y0 + data_.height;
    for (long y = data_.y0 + (std::max(shown - data_.y0, 0L) + lines - 1) / lines * lines; y < end; y += lines)
      read_from(y);
  }

  const FileBytes file_;
  std::unique_ptr<Opened> opened_;
  ExrChannels found_;
  Window data_, display_;
  Imf::InputPart part_;
  int at_ = 0;
  bool begun_ = false;
  std::ptrdiff_t odd_ = 0;
  std::vector<float> band_;
  DecodingMemory held_;
};

}  // namespace

bool is_exr(const FileBytes& file) {
  return file.size >= 4 && file.data[0] == 0x76 && file.data[1] == 0x2f && file.data[2] == 0x31 && file.data[3] == 0x01;
}

ImageInfo exr_info(const FileBytes& file) {
  return checked(file, [&] { return Opened(file, false).info(); });
}

namespace {

std::unique_ptr<FileRows> open(const FileBytes& file, bool depth) {
  return checked(file, [&]() -> std::unique_ptr<FileRows> {
    return std::make_unique<ExrRows>(file, std::make_unique<Opened>(file, depth));
  });
}

}  // namespace

std::unique_ptr<FileRows> open_exr(const FileBytes& file) { return open(file, false); }
std::unique_ptr<FileRows> open_exr_depth(const FileBytes& file) { return open(file, true); }

std::vector<unsigned char> encode_exr(const Image& rgba, const Image& z, bool half_colour,
                                      const std::vector<PictureLayer>& layers) {
  const int width = rgba.width, height = rgba.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  std::vector<half> halves;
  if (half_colour) {
    halves.resize(4 * pixels);
    // Larger values would become infinite in half precision.
    for (std::size_t i = 0; i < halves.size(); ++i) halves[i] = half(std::clamp(rgba.data[i], -65504.0f, 65504.0f));
  }
  const Imf::PixelType type = half_colour ? Imf::HALF : Imf::FLOAT;
  const std::size_t size = half_colour ? sizeof(half) : sizeof(float);
  // OpenEXR uses the same slices for reading, so they take pointers to non-const.
  char* base = half_colour ? reinterpret_cast<char*>(halves.data())
                           : reinterpret_cast<char*>(const_cast<float*>(rgba.data.data()));
  const char* names[4] = {"R", "G", "B", "A"};
  for (int c = 0; c < 4; ++c) {
    header.channels().insert(names[c], Imf::Channel(type));
    buffer.insert(names[c], Imf::Slice(type, base + c * size, 4 * size, 4 * size * width));
  }
  const auto insert = [&](const std::string& name, const Image& image, int channel) {
    const std::size_t step = sizeof(float) * image.channels;
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(image.data.data() + channel)),
                                   step, step * width));
  };
  insert("Z", z, 0);
  for (const PictureLayer& layer : layers)
    for (int c = 0; c < layer.values.channels; ++c)
      insert(layer.name + "." + "XYZ"[layer.values.channels == 1 ? 2 : c], layer.values, c);
  MemoryOutput stream;
  try {
    Imf::OutputFile out(stream, header, 0);
    out.setFrameBuffer(buffer);
    out.writePixels(height);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    fail(Status::internal, "EXR encoding failed: {}", e.what());
  }
  return std::move(stream.bytes);
}

}  // namespace vsplat
