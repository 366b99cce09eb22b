#include "model/io/picture/depth_file.h"

#include <cmath>
#include <memory>
#include <vector>

#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"

namespace vsplat {

DepthImage read_depth(const std::string& path) {
  const std::vector<unsigned char> bytes = read_file(path);
  const FileBytes file{path, bytes.data(), bytes.size()};
  const bool png = is_png(file);
  if (!png && !is_exr(file)) fail(Status::format, "{}: a depth picture is a grey PNG or an EXR", path);
  const std::unique_ptr<FileRows> rows = png ? open_png(file) : open_exr_depth(file);
  const DecodingMemory memory = memory_to_decode(
      file, {rows->width, rows->height, false, 1, sizeof(float) * static_cast<double>(rows->width) * rows->height});
  const float steps = png ? std::ldexp(1.0f, rows->bits) - 1 : 1;  // the values of a PNG are read as 0 to 1
  DepthImage out{Image(rows->width, rows->height, 1), png};
  std::vector<float> row(rows->row_size());
  for (int y = 0; y < rows->height; ++y) {
    rows->next(row.data());
    for (int x = 0; x < rows->width; ++x) {
      const float* pixel = &row[static_cast<std::size_t>(x) * static_cast<std::size_t>(rows->channels)];
      if (png && (pixel[1] != pixel[0] || pixel[2] != pixel[0]))
        fail(Status::format,
             "{}: the pixel at {}, {} has a colour: a depth picture has one value a pixel, not the colours in which "
             "depth is shown",
             path, x, y);
      const float value = steps * pixel[0];
      *out.values.at(x, y) = std::isfinite(value) && value > 0 ? value : 0;
    }
  }
  if (png)
    for (float& v : out.values.data) v = std::round(v);
  return out;
}

}  // namespace vsplat
