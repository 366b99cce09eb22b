#include "model/io/reader/program/gltf_material.h"

#include <fmt/format.h>

#include <cmath>

#include "runtime/printable.h"

namespace vsplat::read {
namespace {

Wrap wrap_of(const Field& of) {
  switch (const std::uint64_t code = of.whole(10497); code) {
    case 10497:
      return Wrap::repeat;
    case 33071:
      return Wrap::clamp;
    case 33648:
      return Wrap::mirror;
    default:
      of.wrong(fmt::format("is {}; 10497 (repeat), 33071 (clamp) or 33648 (mirror) is expected", code));
  }
}

class Materials {
 public:
  Materials(GltfFile& file, MeshTeller& teller) : file_(file), teller_(teller) {}
  GltfMaterial read(const Field& from);

 private:
  MeshTexture texture(const Field& info, GltfPlacement& placement);
  Field picture_of(const Field& texture);
  std::string picture(const Field& image);

  GltfFile& file_;
  MeshTeller& teller_;
  std::set<std::string> sent_;
};

// The picture of a texture: WebP if there is one, otherwise the plain one. Other pictures belong to unsupported
// extensions.
Field Materials::picture_of(const Field& texture) {
  const Field extensions = texture["extensions"];
  const Field webp = extensions["EXT_texture_webp"]["source"];
  if (webp.there()) return webp.in(file_.list("images"));
  if (texture["source"].there()) return texture["source"].in(file_.list("images"));
  for (const std::string& name : extensions.names())
    if (extensions[name.c_str()]["source"].there())
      fail_reading(Status::input, texture.place(),
                   fmt::format("its picture is given only by the extension {}, which is not read; convert it to PNG, "
                               "JPEG or WebP, for example with gltf-transform",
                               printable(name)));
  texture.wrong("has no source: a picture is expected");
}

// The name of a picture's file, or the name under which an embedded picture was sent.
std::string Materials::picture(const Field& image) {
  const Field uri = image["uri"], view = image["bufferView"];
  if (!uri.there() && !view.there()) image.wrong("has neither uri nor bufferView: a picture is expected");
  std::string name = "*" + image.place();
  std::optional<std::vector<unsigned char>> data;
  if (!view.there()) data = file_.inside(uri);
  if (!view.there() && !data) return file_.file_of(uri);
  if (!sent_.insert(name).second) return name;
  if (data)
    teller_.texture(name, *data);
  else
    teller_.texture(name, file_.view(view));
  return name;
}

MeshTexture Materials::texture(const Field& info, GltfPlacement& placement) {
  MeshTexture out;
  if (!info.there()) return out;
  placement.any = true;
  placement.set = info["texCoord"].whole(0);
  const Field moved = info["extensions"]["KHR_texture_transform"];
  placement.set = moved["texCoord"].whole(placement.set);
  placement.rotation = moved["rotation"].number(0);
  for (const auto& [name, to] : {std::pair{"offset", placement.offset}, std::pair{"scale", placement.scale}}) {
    const std::vector<double> values = moved[name].numbers(2);
    std::copy(values.begin(), values.end(), to);
  }
  const Field texture = info["index"].in(file_.list("textures"));
  out.name = picture(picture_of(texture));
  if (!texture["sampler"].there()) return out;
  const Field sampler = texture["sampler"].in(file_.list("samplers"));
  out.wrap_u = wrap_of(sampler["wrapS"]);
  out.wrap_v = wrap_of(sampler["wrapT"]);
  out.nearest = sampler["magFilter"].whole(9729) == 9728;
  return out;
}

GltfMaterial Materials::read(const Field& from) {
  GltfMaterial out;
  MeshMaterial& material = out.material;
  const Field extensions = from["extensions"], glossy = extensions["KHR_materials_pbrSpecularGlossiness"];
  const Field base = glossy.there() ? glossy : from["pbrMetallicRoughness"];
  const std::vector<double> factor = base[glossy.there() ? "diffuseFactor" : "baseColorFactor"].numbers(4);
  material.has_factor = true;
  std::copy(factor.begin(), factor.end(), material.factor.begin());
  material.texture = texture(base[glossy.there() ? "diffuseTexture" : "baseColorTexture"], out.base);
  const std::vector<double> light = from["emissiveFactor"].numbers(3);
  const double strength = extensions["KHR_materials_emissive_strength"]["emissiveStrength"].number(1);
  for (std::size_t i = 0; i < light.size(); ++i) material.emission[i] = static_cast<float>(light[i] * strength);
  const bool shines = material.emission != std::array<float, 3>{};
  if (shines) material.emission_texture = texture(from["emissiveTexture"], out.emission);
  const std::string mode = from["alphaMode"].text("OPAQUE");
  if (mode != "OPAQUE" && mode != "MASK" && mode != "BLEND")
    from["alphaMode"].wrong(fmt::format("\"{}\" is not known: OPAQUE, MASK or BLEND is expected", printable(mode)));
  material.alpha = mode == "MASK" ? AlphaMode::mask : mode == "BLEND" ? AlphaMode::blend : AlphaMode::none;
  material.cutoff = static_cast<float>(from["alphaCutoff"].number(0.5));
  return out;
}

}  // namespace

std::array<float, 2> GltfPlacement::placed(const float* uv) const {
  const double u = scale[0] * static_cast<double>(uv[0]), v = scale[1] * static_cast<double>(uv[1]);
  const double sine = std::sin(rotation), cosine = std::cos(rotation);  // counter-clockwise, with v pointing down
  return {static_cast<float>(cosine * u + sine * v + offset[0]),
          static_cast<float>(1 - (cosine * v - sine * u + offset[1]))};
}

std::vector<GltfMaterial> read_materials(GltfFile& file, const std::set<std::size_t>& used, MeshTeller& teller) {
  Materials reader(file, teller);
  const Field list = file.list("materials");
  std::vector<GltfMaterial> out(list.size() + 1);
  for (const std::size_t i : used)
    if (i < list.size()) out[i] = reader.read(list[i]);
  return out;
}

}  // namespace vsplat::read
