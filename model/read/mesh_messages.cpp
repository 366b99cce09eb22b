#include "model/read/mesh_messages.h"

#include <cmath>

namespace vsplat::read {
namespace {

float finite(Unpacker& in) {
  const auto out = in.get<float>();
  if (!std::isfinite(out)) throw BadMessage("a material with a number that is not finite");
  return out;
}

}  // namespace

void pack(const MeshMaterial& material, Packer& out) {
  out.put(std::uint32_t{material.has_texture}).text(material.texture);
  out.put(std::uint32_t{material.has_factor});
  for (const float value : material.factor) out.put(value);
  out.put(std::uint32_t{material.has_diffuse});
  for (const float value : material.diffuse) out.put(value);
  out.put(static_cast<std::uint32_t>(material.alpha)).put(material.cutoff);
}

MeshMaterial unpack_material(Unpacker& in) {
  MeshMaterial out;
  out.has_texture = in.flag();
  out.texture = in.text();
  out.has_factor = in.flag();
  for (float& value : out.factor) value = finite(in);
  out.has_diffuse = in.flag();
  for (float& value : out.diffuse) value = finite(in);
  const auto alpha = in.get<std::uint32_t>();
  if (alpha > static_cast<std::uint32_t>(AlphaMode::blend)) throw BadMessage("a material with an unknown alpha mode");
  out.alpha = static_cast<AlphaMode>(alpha);
  out.cutoff = finite(in);
  return out;
}

}  // namespace vsplat::read
