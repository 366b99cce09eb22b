#include "model/io/scene/sog_meta.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "model/base/json_fields.h"
#include "model/io/scene/scene_notes.h"
#include "runtime/fail.h"
#include "runtime/json_text.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

using json_fields::shown;
using nlohmann::json;

constexpr std::uint64_t kMostSogGaussians = 16383ull * 16383;  // the texels of the largest WebP
constexpr std::uint64_t kMostSogVectors = 65536;

// An object of meta.json, with its place in messages.
class SogObject {
 public:
  SogObject(const std::string& what, const json& value, std::string place)
      : what_(what), value_(value), place_(std::move(place)) {
    if (!value.is_object()) wrong("", "an object");
  }

  bool has(const char* name) const { return value_.contains(name) && !value_[name].is_null(); }
  SogObject object(const char* name) const { return {what_, field(name, "an object"), at(name)}; }

  std::uint64_t whole(const char* name, std::uint64_t least, std::uint64_t most) const {
    const std::string expected = fmt::format("a whole number from {} to {}", least, most);
    const json& v = field(name, expected);
    if (!v.is_number_unsigned() || v.get<std::uint64_t>() < least || v.get<std::uint64_t>() > most)
      wrong(name, expected);
    return v.get<std::uint64_t>();
  }

  // Finite numbers; one that stands alone counts as a list.
  std::vector<double> numbers(const char* name, std::size_t count) const {
    const std::string expected = fmt::format("{} finite number{}", count, count == 1 ? "" : "s");
    const json& v = field(name, expected);
    if (count == 1 && v.is_number()) return {number(v, name, expected)};
    if (!v.is_array() || v.size() != count) wrong(name, expected);
    std::vector<double> out;
    for (const json& one : v) out.push_back(number(one, name, expected));
    return out;
  }

  std::vector<std::string> files(std::size_t count) const {
    const std::string expected = fmt::format("{} plain file name{}", count, count == 1 ? "" : "s");
    const json& v = field("files", expected);
    if (!v.is_array() || v.size() < count) wrong("files", expected);
    std::vector<std::string> out;
    for (std::size_t i = 0; i < count; ++i) {
      if (!v[i].is_string()) wrong("files", expected);
      const std::string& name = out.emplace_back(v[i].get<std::string>());
      const bool plain =
          !name.empty() && name.size() <= 255 && name != "." && name != ".." &&
          std::none_of(name.begin(), name.end(), [](char c) {
            return static_cast<unsigned char>(c) < ' ' || c == '/' || c == '\\' || c == ':' || c == '\x7f';
          });
      if (!plain) wrong("files", expected);
    }
    return out;
  }

  SogTable codebook() const {
    const char* expected = "a list of 1 to 256 numbers";
    const json& v = field("codebook", expected);
    if (!v.is_array() || v.empty() || v.size() > 256) wrong("codebook", expected);
    SogTable out;
    out.fill(std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0; i < v.size(); ++i)
      if (!v[i].is_null()) out[i] = static_cast<float>(number(v[i], "codebook", expected));
    return out;
  }

  [[noreturn]] void wrong(const char* name, const std::string& expected) const {
    const bool there = value_.is_object() && value_.contains(name);
    fail(Status::format, "{}: {} is {}: {} expected", what_, at(name),
         there                ? shown(value_[name])
         : value_.is_object() ? "missing"
                              : shown(value_),
         expected);
  }

 private:
  std::string at(const std::string& name) const {
    return place_.empty() ? (name.empty() ? "its content" : name) : name.empty() ? place_ : place_ + "." + name;
  }
  const json& field(const char* name, const std::string& expected) const {
    if (!has(name)) wrong(name, expected);
    return value_[name];
  }
  double number(const json& v, const char* name, const std::string& expected) const {
    if (!v.is_number() || !(std::abs(v.get<double>()) <= std::numeric_limits<float>::max())) wrong(name, expected);
    return v.get<double>();
  }

  const std::string& what_;
  const json& value_;
  std::string place_;
};

// Bytes as even steps between two numbers (version 1).
SogTable even_steps(double low, double high) {
  SogTable out;
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = static_cast<float>(low + (high - low) * static_cast<double>(i) / 255);
  return out;
}

void read_version_2(const SogObject& root, SogMeta& out) {
  out.count = static_cast<std::size_t>(root.whole("count", 1, kMostSogGaussians));
  out.scales.fill(root.object("scales").codebook());
  out.colours.fill(root.object("sh0").codebook());
  out.opacities = even_steps(0, 1);
  if (!root.has("shN")) return;
  const SogObject sh = root.object("shN");
  out.degree = static_cast<int>(sh.whole("bands", 0, 3));
  out.has_sh = out.degree > 0;
  if (!out.has_sh) return;
  out.palette = static_cast<std::size_t>(sh.whole("count", 1, kMostSogVectors));
  out.sh = sh.codebook();
}

void read_version_1(const json& value, const SogObject& root, SogMeta& out) {
  const SogObject means = root.object("means");
  // The number of Gaussians is the first number of an array's shape.
  const auto shape = value["means"].find("shape");
  if (shape == value["means"].end() || !shape->is_array() || shape->empty() || !(*shape)[0].is_number_unsigned() ||
      (*shape)[0].get<std::uint64_t>() < 1 || (*shape)[0].get<std::uint64_t>() > kMostSogGaussians)
    means.wrong("shape", fmt::format("a list that begins with the number of Gaussians, 1 to {},", kMostSogGaussians));
  out.count = static_cast<std::size_t>((*shape)[0].get<std::uint64_t>());
  const SogObject scales = root.object("scales"), sh0 = root.object("sh0");
  const std::vector<double> scale_mins = scales.numbers("mins", 3), scale_maxs = scales.numbers("maxs", 3);
  const std::vector<double> mins = sh0.numbers("mins", 4), maxs = sh0.numbers("maxs", 4);
  for (std::size_t i = 0; i < 3; ++i) {
    out.scales[i] = even_steps(scale_mins[i], scale_maxs[i]);
    out.colours[i] = even_steps(mins[i], maxs[i]);
  }
  for (std::size_t i = 0; i < 256; ++i) {
    const double logit = mins[3] + (maxs[3] - mins[3]) * static_cast<double>(i) / 255;
    out.opacities[i] = static_cast<float>(1 / (1 + std::exp(-logit)));
  }
  out.has_sh = root.has("shN");
  if (!out.has_sh) return;
  const SogObject sh = root.object("shN");
  out.sh = even_steps(sh.numbers("mins", 1)[0], sh.numbers("maxs", 1)[0]);
}

}  // namespace

SogMeta parse_sog_meta(const std::string& what, const std::string& text) {
  const json value = parse_json(what, text);
  const SogObject root(what, value, "");
  SogMeta out;
  if (!root.has("version") || root.whole("version", 1, 1000000) == 1)
    read_version_1(value, root, out);
  else if (root.whole("version", 2, 1000000) == 2)
    read_version_2(root, out);
  else
    fail(Status::format, "{}: version {}: versions 1 and 2 are read", what, root.whole("version", 2, 1000000));
  const SogObject means = root.object("means");
  const std::vector<double> mins = means.numbers("mins", 3), maxs = means.numbers("maxs", 3);
  std::copy(mins.begin(), mins.end(), out.mins.begin());
  std::copy(maxs.begin(), maxs.end(), out.maxs.begin());
  out.means_low = means.files(2)[0];
  out.means_high = means.files(2)[1];
  out.scales_file = root.object("scales").files(1)[0];
  out.quats_file = root.object("quats").files(1)[0];
  out.sh0_file = root.object("sh0").files(1)[0];
  if (out.has_sh) {
    out.centroids_file = root.object("shN").files(2)[0];
    out.labels_file = root.object("shN").files(2)[1];
  }
  if (const auto model = value.find("model"); model != value.end() && model->is_string()) {
    const std::string mode = model->get<std::string>();
    out.scene.antialias = mode == "antialiased" || mode == "mip";  // mip: as in a PLY file
    if (!out.scene.antialias && mode != "default" && mode != "2dgs")
      warn("{}: model {} is ignored: default, antialiased or 2dgs expected", what, shown(*model));
  }
  if (const auto flag = value.find("antialias"); flag != value.end() && flag->is_boolean())
    out.scene.antialias = out.scene.antialias || flag->get<bool>();
  if (const auto notes = value.find("vsplat"); notes != value.end()) read_notes(what, *notes, out.scene);
  return out;
}

}  // namespace vsplat
