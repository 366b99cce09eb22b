#include <ImfChannelList.h>
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
#include <new>
#include <stdexcept>

#include "model/io/exr_header.h"
#include "model/io/image_formats.h"
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

// Refuses a header that claims more than the file can hold before memory is taken for it: no coder but DWA's packs a
// run of equal samples more than 2048 times (deflate's limit is 1032).
void check_plausible(const FileBytes& file, const Imf::Header& header, const Window& data, int channels) {
  if (header.compression() == Imf::DWAA_COMPRESSION || header.compression() == Imf::DWAB_COMPRESSION) return;
  const double least = 2.0 * channels * static_cast<double>(data.width) * static_cast<double>(data.height) / 2048;
  if (least > static_cast<double>(file.size))
    fail(Status::format, "{}: a damaged or cut-off EXR: {} bytes cannot hold its {} x {} pixels", file.path, file.size,
         data.width, data.height);
}

// R, G, B or Y alone, with or without A.
struct Channels {
  bool grey = false, alpha = false;
};

Channels find_channels(const FileBytes& file, const Imf::Header& header) {
  const Imf::ChannelList& list = header.channels();
  std::string found;
  for (auto it = list.begin(); it != list.end(); ++it) found += (found.empty() ? "" : ", ") + std::string(it.name());
  Channels out;
  out.grey = !list.findChannel("R") && list.findChannel("Y") && !list.findChannel("RY") && !list.findChannel("BY");
  out.alpha = list.findChannel("A") != nullptr;
  for (const char* name : {"R", "G", "B"})
    if (!out.grey && !list.findChannel(name))
      fail(Status::format, "{}: an EXR with the channels {}; R, G, B (and A), or Y (and A), are expected", file.path,
           printable(found));
  for (const char* name : {"R", "G", "B", "Y", "A"}) {
    const Imf::Channel* channel = list.findChannel(name);
    if (!channel || (out.grey && std::strchr("RGB", *name)) || (!out.grey && *name == 'Y')) continue;
    if (channel->type == Imf::UINT)
      fail(Status::format, "{}: channel {} holds integers; half or float is expected", file.path, name);
    if (channel->xSampling != 1 || channel->ySampling != 1)
      fail(Status::format, "{}: channel {} is subsampled ({} x {}), which is not supported", file.path, name,
           channel->xSampling, channel->ySampling);
  }
  return out;
}

void check_kind(const FileBytes& file, const Imf::Header& header) {
  if (header.hasType() && header.type() != Imf::SCANLINEIMAGE && header.type() != Imf::TILEDIMAGE)
    fail(Status::format, "{}: an EXR of type {}; scanline or tiled is expected", file.path, printable(header.type()));
  const Window display = window_of(header.displayWindow()), data = window_of(header.dataWindow());
  check_image_size(file.path, display.width, display.height);
  check_image_size(file.path, data.width, data.height);
}

// Calls `work` on the first part; what OpenEXR throws becomes Error(format).
template <class Work>
auto with_part(const FileBytes& file, Work work) {
  try {
    check_exr_header(file);
    MemoryInput stream(file);
    Imf::MultiPartInputFile parts(stream, 0);
    check_kind(file, parts.header(0));
    return work(parts);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    fail(Status::format, "{}: a damaged or cut-off EXR: {}", file.path, printable(e.what()));
  }
}

float in_unit(float v) {
  return v > 0 ? std::fmin(v, 1.0f) : 0.0f;  // NaN is not > 0
}

// Linear, premultiplied -> sRGB-encoded, straight.
void to_display(float* pixel, bool alpha) {
  const float a = alpha ? in_unit(pixel[3]) : 1.0f;
  for (int c = 0; c < 3; ++c) pixel[c] = a > 0 ? in_unit(srgb_encode(in_unit(pixel[c] / a))) : 0.0f;
  if (alpha) pixel[3] = a;
}

// The data window's pixels, as stored.
Image read_pixels(Imf::MultiPartInputFile& parts, const Channels& channels, const Window& data) {
  Image out(static_cast<int>(data.width), static_cast<int>(data.height), channels.alpha ? 4 : 3);
  const std::size_t step = sizeof(float) * out.channels, stride = step * out.width;
  Imf::FrameBuffer buffer;
  const auto slice = [&](const char* name, int c) {
    buffer.insert(name, Imf::Slice::Make(Imf::FLOAT, out.data.data() + c, parts.header(0).dataWindow(), step, stride));
  };
  if (channels.grey)
    slice("Y", 0);
  else {
    slice("R", 0);
    slice("G", 1);
    slice("B", 2);
  }
  if (channels.alpha) slice("A", 3);
  Imf::InputPart part(parts, 0);
  part.setFrameBuffer(buffer);
  part.readPixels(parts.header(0).dataWindow().min.y, parts.header(0).dataWindow().max.y);
  if (channels.grey)
    for (std::size_t i = 0; i < out.data.size(); i += out.channels) out.data[i + 1] = out.data[i + 2] = out.data[i];
  return out;
}

}  // namespace

bool is_exr(const FileBytes& file) {
  return file.size >= 4 && file.data[0] == 0x76 && file.data[1] == 0x2f && file.data[2] == 0x31 && file.data[3] == 0x01;
}

ImageInfo exr_info(const FileBytes& file) {
  return with_part(file, [](const Imf::MultiPartInputFile& parts) {
    const Window display = window_of(parts.header(0).displayWindow());
    const bool alpha = parts.header(0).channels().findChannel("A") != nullptr;
    return ImageInfo{static_cast<int>(display.width), static_cast<int>(display.height), alpha};
  });
}

// The picture is the display window; the data window may be smaller (nothing, alpha 0, around it) or larger (cut).
Image decode_exr(const FileBytes& file) {
  return with_part(file, [&](Imf::MultiPartInputFile& parts) {
    const Imf::Header& header = parts.header(0);
    const Channels channels = find_channels(file, header);
    const Window data = window_of(header.dataWindow()), display = window_of(header.displayWindow());
    check_plausible(file, header, data, (channels.grey ? 1 : 3) + (channels.alpha ? 1 : 0));
    Image stored = read_pixels(parts, channels, data);
    const auto odd = std::count_if(stored.data.begin(), stored.data.end(), [](float v) { return !std::isfinite(v); });
    if (odd > 0)
      warn("{}: {} of its {} values are no finite numbers: NaN is taken as 0, what is infinite as the end of the range",
           file.path, odd, stored.data.size());
    for (std::size_t i = 0; i < stored.data.size(); i += stored.channels) to_display(&stored.data[i], channels.alpha);
    if (data.x0 == display.x0 && data.y0 == display.y0 && data.width == display.width && data.height == display.height)
      return stored;
    Image out(static_cast<int>(display.width), static_cast<int>(display.height), stored.channels);
    const long left = std::max(data.x0, display.x0), right = std::min(data.x0 + data.width, display.x0 + display.width);
    const long top = std::max(data.y0, display.y0),
               bottom = std::min(data.y0 + data.height, display.y0 + display.height);
    for (long y = top; y < bottom && left < right; ++y)
      std::copy_n(stored.at(static_cast<int>(left - data.x0), static_cast<int>(y - data.y0)),
                  (right - left) * stored.channels,
                  out.at(static_cast<int>(left - display.x0), static_cast<int>(y - display.y0)));
    return out;
  });
}

std::vector<unsigned char> encode_exr(const Image& rgba, const Image& z, bool half_colour) {
  const int width = rgba.width, height = rgba.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  Imf::Header header(width, height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  std::vector<half> halves;
  if (half_colour) {
    halves.resize(4 * pixels);
    // Beyond half's range a value would become infinite.
    for (std::size_t i = 0; i < halves.size(); ++i) halves[i] = half(std::clamp(rgba.data[i], -65504.0f, 65504.0f));
  }
  const Imf::PixelType type = half_colour ? Imf::HALF : Imf::FLOAT;
  const std::size_t size = half_colour ? sizeof(half) : sizeof(float);
  // OpenEXR's slices are for reading, too, and so take pointers to what may change.
  char* base = half_colour ? reinterpret_cast<char*>(halves.data())
                           : reinterpret_cast<char*>(const_cast<float*>(rgba.data.data()));
  const char* names[4] = {"R", "G", "B", "A"};
  for (int c = 0; c < 4; ++c) {
    header.channels().insert(names[c], Imf::Channel(type));
    buffer.insert(names[c], Imf::Slice(type, base + c * size, 4 * size, 4 * size * width));
  }
  header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
  buffer.insert("Z", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(z.data.data())), sizeof(float),
                                sizeof(float) * width));
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
