#include "model/data/paints.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "model/base/resample.h"
#include "model/io/picture/image_file.h"
#include "model/io/picture/picture_folder.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

using Eigen::Vector3f;

constexpr int texels = 128;      // of a pattern
constexpr int max_texels = 512;  // of a picture
constexpr std::size_t kept_bytes = std::size_t{128} << 20;

// The weight of the second colour at (u, v), in [0,1].
using Pattern = std::function<double(double, double)>;

Pattern random_pattern(Random& random) {
  const int kind = random.below(4), n = 2 + 2 * random.below(4), m = 1 + random.below(5);
  std::array<double, 12> r{};
  for (double& v : r) v = random.uniform();
  const auto clouds = [=](double u, double v) {
    double sum = 0;
    for (int k = 0; k < 4; ++k)
      sum +=
          std::sin(2 * M_PI * ((k + 1) * u + r[3 * k])) * std::sin(2 * M_PI * ((m + k) * v + r[3 * k + 1])) / (k + 1);
    return std::clamp(0.5 + 0.6 * sum, 0.0, 1.0);
  };
  const auto checks = [=](double u, double v) {
    return static_cast<double>((static_cast<int>(n * u) + static_cast<int>(n * v)) % 2);
  };
  const auto stripes = [=](double u, double v) { return std::fmod(m * u + n * v, 1.0) < 0.3 + 0.4 * r[0] ? 1.0 : 0.0; };
  const auto spots = [=](double u, double v) {
    const double x = std::fmod(n * u, 1.0) - 0.5, y = std::fmod(n * v, 1.0) - 0.5;
    return std::hypot(x, y) < 0.2 + 0.2 * r[0] ? 1.0 : 0.0;
  };
  if (kind == 0) return checks;
  if (kind == 1) return stripes;
  if (kind == 2) return spots;
  return clouds;
}

Vector3f colour_of(double hue, double saturation, double value) {
  Vector3f out;
  for (int c = 0; c < 3; ++c) {
    const double ramp = std::clamp(std::abs(std::fmod(hue + 2.0 * c, 6.0) - 3) - 1, 0.0, 1.0);
    out[c] = static_cast<float>(value * (1 - saturation + saturation * ramp));
  }
  return out;
}

// A random sRGB colour: any hue, from grey to saturated, from dark to light.
Vector3f random_colour(Random& random) {
  const double hue = random.uniform(0, 6), saturation = std::sqrt(random.uniform()), value = random.uniform(0.25, 1);
  return colour_of(hue, saturation, value);
}

// A random linear colour, paler and lighter than a pattern's, like most real objects.
Vector3f random_paint_colour(Random& random) {
  const double hue = random.uniform(0, 6), saturation = 0.9 * random.uniform(), value = random.uniform(0.15, 1.2);
  return colour_of(hue, saturation, std::min(value, 1.0)).unaryExpr([](float c) { return srgb_decode(c); });
}

}  // namespace

std::shared_ptr<const Texture> random_texture(Random& random) {
  const Vector3f first = random_colour(random), second = random_colour(random);
  const Pattern pattern = random_pattern(random);
  Image picture(texels, texels, 3);
  for (int y = 0; y < texels; ++y)
    for (int x = 0; x < texels; ++x) {
      const auto share = static_cast<float>(pattern((x + 0.5) / texels, (y + 0.5) / texels));
      for (int c = 0; c < 3; ++c) picture.at(x, y)[c] = (1 - share) * first[c] + share * second[c];
    }
  return texture_of(picture);
}

TextureFolder::TextureFolder(const std::string& path) : kept_(kept_bytes) {
  for (const std::filesystem::path& file : pictures_in(path)) files_.push_back(file.string());
  if (files_.empty()) fail(Status::input, "{}: holds no picture; a folder of textures is expected", path);
}

std::shared_ptr<const Texture> TextureFolder::at(std::size_t index) const {
  if (auto found = kept_.find(index)) return found;
  const ImageFile file(files_.at(index));
  const std::unique_ptr<PixelRows> stored = file.rows();
  Image picture;
  if (const int longer = std::max(stored->width, stored->height); longer > max_texels) {
    const double step = static_cast<double>(longer) / max_texels;
    const auto size = [&](int side) { return std::max(static_cast<int>(side / step + 1e-9), 1); };
    const int columns = size(stored->width);
    PremultipliedRows source(*stored);
    picture = on_white(resample(source, {0, 0, columns * step, columns, size(stored->height)}));
  } else if (stored->channels == 4) {
    PremultipliedRows source(*stored);
    picture = on_white(image_of(source));  // surfaces have no holes
  } else {
    picture = image_of(*stored);
  }
  auto made = texture_of(picture);
  kept_.put(index, made, made->rgb.size() + sizeof(Texture));
  return made;
}

Paint random_paint(Random& random, const TextureFolder* textures) {
  Paint out;
  const double kind = random.uniform();
  const int times = 1 + random.below(3);
  out.repeats = Eigen::Vector2f::Constant(static_cast<float>(times));
  out.begins = {static_cast<float>(random.uniform()), static_cast<float>(random.uniform())};
  if (textures && kind < 0.5) {
    out.material.texture = textures->at(static_cast<std::size_t>(random.below(static_cast<int>(textures->count()))));
    if (random.uniform() < 0.2) out.material.colour = random_paint_colour(random);
  } else if (kind < 0.7) {
    out.material.colour = random_paint_colour(random);
  } else if (kind < 0.85) {
    out.gradient = true;
    for (Vector3f& colour : out.colours) colour = random_paint_colour(random);
    if (random.below(2) == 0) out.colours[1] = 0.5f * (out.colours[0] + out.colours[2]);
    const double height = random.uniform(-1, 1), azimuth = random.uniform(0, 2 * M_PI),
                 level = std::sqrt(1 - height * height);
    out.along = Eigen::Vector3d(level * std::cos(azimuth), height, level * std::sin(azimuth)).cast<float>();
  } else {
    out.material.texture = random_texture(random);
  }
  return out;
}

Vector3f gradient_colour(const Paint& paint, float at) {
  const float inside = std::clamp(at, 0.0f, 2.0f);
  const int first = inside < 1 ? 0 : 1;
  const float share = inside - static_cast<float>(first);
  return (1 - share) * paint.colours[first] + share * paint.colours[first + 1];
}

void apply(const Paint& paint, std::vector<Corner>& corners) {
  for (Corner& c : corners) c.uv = paint.begins + paint.repeats.cwiseProduct(c.uv);
  if (!paint.gradient || corners.empty()) return;
  float low = std::numeric_limits<float>::max(), high = -low;
  for (const Corner& c : corners) {
    low = std::min(low, c.position.dot(paint.along));
    high = std::max(high, c.position.dot(paint.along));
  }
  const float extent = std::max(high - low, 1e-6f);
  for (Corner& c : corners) c.colour = gradient_colour(paint, 2 * (c.position.dot(paint.along) - low) / extent);
}

}  // namespace vsplat
