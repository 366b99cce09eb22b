#include "model/io/reader/program/mesh_teller.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "runtime/printable.h"

namespace vsplat::read {
namespace {

constexpr std::size_t batch = 3 * 16'384;  // corners per message

template <std::size_t n>
bool finite(const std::array<float, n>& all) {
  return std::all_of(all.begin(), all.end(), [](float v) { return std::isfinite(v); });
}

}  // namespace

void MeshTeller::texture(const std::string& name, std::span<const unsigned char> encoded) {
  Packer body;
  body.text(name).raw(encoded.data(), encoded.size());
  library_.say(Kind::texture, body);
}

void MeshTeller::materials(const std::vector<MeshMaterial>& all) {
  Packer body;
  body.put(static_cast<std::uint32_t>(all.size()));
  for (const MeshMaterial& material : all) pack(material, body);
  library_.say(Kind::materials, body);
}

void MeshTeller::part(const MeshPart& part) {
  say_corners();
  part_ = part.name;
  Packer head;
  pack(part, head);
  library_.say(Kind::part, head);
}

void MeshTeller::corner(MeshCorner corner, std::uint64_t vertex) {
  auto& n = corner.normal;
  const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  if (length > 1e-6f && std::isfinite(length))
    n = {n[0] / length, n[1] / length, n[2] / length};
  else
    n = {};
  for (float& value : corner.colour) value = std::clamp(value, 0.0f, 1.0f);
  if (!finite(corner.position) || !finite(corner.uv) || !finite(corner.emission_uv) || !finite(corner.colour))
    fail_reading(Status::input, "",
                 fmt::format("vertex {} of part \"{}\" is at {}, {}, {} with texture coordinates {}, {}; all finite is "
                             "expected",
                             vertex, printable(part_), corner.position[0], corner.position[1], corner.position[2],
                             corner.uv[0], corner.uv[1]));
  corners_.push_back(corner);
  if (corners_.size() == batch) say_corners();
}

void MeshTeller::say_corners() {
  if (!corners_.empty())
    library_.say(Kind::corners, Packer().raw(corners_.data(), corners_.size() * sizeof(MeshCorner)));
  corners_.clear();
}

void MeshTeller::done() {
  say_corners();
  library_.say(Kind::done);
}

}  // namespace vsplat::read
