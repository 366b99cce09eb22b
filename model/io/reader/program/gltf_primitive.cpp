#include "model/io/reader/program/gltf_primitive.h"

#include <fmt/format.h>

#include <numeric>

namespace vsplat::read {

bool has_triangles(const Field& primitive) {
  const std::uint64_t mode = primitive["mode"].whole(4);
  if (mode > 6) primitive["mode"].wrong(fmt::format("is {}; 0 to 6 are expected", mode));
  return mode >= 4;
}

GltfPrimitive::GltfPrimitive(GltfFile& file, const Field& primitive, const std::vector<double>& weights)
    : file_(file), primitive_(primitive), weights_(weights) {
  const Field packed = primitive["extensions"]["KHR_draco_mesh_compression"];
  if (packed.there()) draco_ = std::make_unique<DracoMesh>(file, packed);
  const Field accessor = primitive["attributes"]["POSITION"].in(file.list("accessors"));
  positions_ = draco_ && draco_->has("POSITION") ? draco_->numbers("POSITION", accessor, {3})
                                                 : read_numbers(file, primitive["attributes"]["POSITION"], {3});
  morph("POSITION", positions_);
}

std::optional<Numbers> GltfPrimitive::attribute(const std::string& name, const std::vector<std::size_t>& widths) {
  const Field number = primitive_["attributes"][name.c_str()];
  if (!number.there()) return std::nullopt;
  Numbers out = draco_ && draco_->has(name) ? draco_->numbers(name, number.in(file_.list("accessors")), widths)
                                            : read_numbers(file_, number, widths);
  if (out.count != count())
    number.wrong(fmt::format("its accessor has {} elements, there are {} vertices", out.count, count()));
  morph(name, out);
  return out;
}

std::vector<std::uint32_t> GltfPrimitive::wholes(const std::string& name) {
  const Field number = primitive_["attributes"][name.c_str()];
  std::vector<std::uint32_t> out;
  if (draco_ && draco_->has(name)) {
    // Joint indices are small, so floats hold them exactly.
    const Numbers numbers = draco_->numbers(name, number.in(file_.list("accessors")), {4});
    for (const float value : numbers.values) out.push_back(value > 0 ? static_cast<std::uint32_t>(value) : 0);
  } else {
    out = read_wholes(file_, number, 4);
  }
  if (out.size() != 4 * count())
    number.wrong(fmt::format("its accessor has {} elements, there are {} vertices", out.size() / 4, count()));
  return out;
}

// Adds the morph targets' changes, multiplied by their weights.
void GltfPrimitive::morph(const std::string& name, Numbers& numbers) {
  const Field targets = primitive_["targets"];
  for (std::size_t t = 0; t < targets.size() && t < weights_.size(); ++t) {
    const Field number = targets[t][name.c_str()];
    if (weights_[t] == 0 || !number.there()) continue;
    const Numbers change = read_numbers(file_, number, {numbers.width});
    if (change.count != numbers.count)
      number.wrong(fmt::format("its accessor has {} elements, there are {} vertices", change.count, numbers.count));
    for (std::size_t i = 0; i < numbers.values.size(); ++i)
      numbers.values[i] += static_cast<float>(weights_[t]) * change.values[i];
  }
}

std::vector<std::uint32_t> GltfPrimitive::indices() {
  const Field number = primitive_["indices"];
  std::vector<std::uint32_t> out;
  if (draco_) {
    out = draco_->indices();
  } else if (number.there()) {
    out = read_wholes(file_, number, 1);
  } else {
    out.resize(count());
    std::iota(out.begin(), out.end(), 0u);
  }
  for (std::size_t i = 0; i < out.size(); ++i)
    if (out[i] >= count()) number.wrong(fmt::format("element {} is vertex {}, there are {}", i, out[i], count()));
  return out;
}

std::vector<std::uint32_t> GltfPrimitive::triangles() {
  const std::vector<std::uint32_t> from = indices();
  const std::uint64_t mode = draco_ ? 4 : primitive_["mode"].whole(4);
  std::vector<std::uint32_t> out;
  if (mode == 4) {
    out.assign(from.begin(), from.end() - static_cast<std::ptrdiff_t>(from.size() % 3));
    return out;
  }
  for (std::size_t i = 2; i < from.size(); ++i) {
    if (mode == 6)
      out.insert(out.end(), {from[i - 1], from[i], from[0]});
    else if (i % 2 == 0)
      out.insert(out.end(), {from[i - 2], from[i - 1], from[i]});
    else
      out.insert(out.end(), {from[i - 1], from[i - 2], from[i]});
  }
  return out;
}

}  // namespace vsplat::read
