#include "model/io/reader/mesh_messages.h"

#include <cmath>

namespace vsplat::read {
namespace {

float finite(Unpacker& in) {
  const auto out = in.get<float>();
  if (!std::isfinite(out)) throw BadMessage("a material with a number that is not finite");
  return out;
}

template <class Choice>
Choice choice(Unpacker& in, Choice last, const char* what) {
  const auto out = in.get<std::uint32_t>();
  if (out > static_cast<std::uint32_t>(last)) throw BadMessage(std::string("a material with an unknown ") + what);
  return static_cast<Choice>(out);
}

void pack_texture(const MeshTexture& texture, Packer& out) {
  out.text(texture.name);
  out.put(static_cast<std::uint32_t>(texture.wrap_u)).put(static_cast<std::uint32_t>(texture.wrap_v));
  out.put(std::uint32_t{texture.nearest});
}

MeshTexture unpack_texture(Unpacker& in) {
  MeshTexture out;
  out.name = in.text();
  out.wrap_u = choice(in, Wrap::mirror, "way to repeat a texture");
  out.wrap_v = choice(in, Wrap::mirror, "way to repeat a texture");
  out.nearest = in.flag();
  return out;
}

}  // namespace

void pack(const MeshMaterial& material, Packer& out) {
  pack_texture(material.texture, out);
  out.put(std::uint32_t{material.has_factor});
  for (const float value : material.factor) out.put(value);
  out.put(std::uint32_t{material.has_diffuse});
  for (const float value : material.diffuse) out.put(value);
  pack_texture(material.emission_texture, out);
  for (const float value : material.emission) out.put(value);
  out.put(static_cast<std::uint32_t>(material.alpha)).put(material.cutoff);
}

MeshMaterial unpack_material(Unpacker& in) {
  MeshMaterial out;
  out.texture = unpack_texture(in);
  out.has_factor = in.flag();
  for (float& value : out.factor) value = finite(in);
  out.has_diffuse = in.flag();
  for (float& value : out.diffuse) value = finite(in);
  out.emission_texture = unpack_texture(in);
  for (float& value : out.emission) value = finite(in);
  out.alpha = choice(in, AlphaMode::blend, "alpha mode");
  out.cutoff = finite(in);
  return out;
}

}  // namespace vsplat::read
