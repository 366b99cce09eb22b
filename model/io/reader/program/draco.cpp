#include "model/io/reader/program/draco.h"

#include <draco/compression/decode.h>
#include <draco/mesh/mesh.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "runtime/printable.h"

namespace vsplat::read {

struct DracoMesh::Mesh {
  std::unique_ptr<draco::Mesh> all;
};

DracoMesh::DracoMesh(GltfFile& file, const Field& extension) : extension_(extension), mesh_(new Mesh) {
  const Bytes packed = file.view(extension["bufferView"]);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(packed.data()), packed.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok())
    extension_.wrong(fmt::format("cannot be decompressed: {}", printable(decoded.status().error_msg_string())));
  mesh_->all = std::move(decoded).value();
}

DracoMesh::~DracoMesh() = default;

bool DracoMesh::has(const std::string& attribute) const { return extension_["attributes"][attribute.c_str()].there(); }

Numbers DracoMesh::numbers(const std::string& attribute, const Field& accessor,
                           const std::vector<std::size_t>& widths) const {
  const Field id = extension_["attributes"][attribute.c_str()];
  const draco::PointAttribute* from = mesh_->all->GetAttributeByUniqueId(static_cast<std::uint32_t>(id.whole()));
  if (!from) id.wrong(fmt::format("is {}; no such attribute is in the compressed mesh", id.whole()));
  Numbers out;
  out.count = mesh_->all->num_points();
  out.width = static_cast<std::size_t>(from->num_components());
  if (out.width > 4 || std::find(widths.begin(), widths.end(), out.width) == widths.end())
    id.wrong(fmt::format("has {} numbers each; {} are expected", out.width, fmt::join(widths, " or ")));
  out.values.resize(out.count * out.width);
  const float scale = from->normalized() ? 1 : accessor_scale(accessor);
  std::array<float, 4> one{};
  for (std::size_t i = 0; i < out.count; ++i) {
    const auto place = from->mapped_index(draco::PointIndex(static_cast<std::uint32_t>(i)));
    if (!from->ConvertValue<float>(place, static_cast<std::int8_t>(out.width), one.data()))
      id.wrong(fmt::format("element {} cannot be read", i));
    for (std::size_t c = 0; c < out.width; ++c)
      out.values[i * out.width + c] = scale == 1 ? one[c] : std::max(-1.0f, one[c] * scale);
  }
  return out;
}

std::vector<std::uint32_t> DracoMesh::indices() const {
  std::vector<std::uint32_t> out;
  out.reserve(3 * static_cast<std::size_t>(mesh_->all->num_faces()));
  for (std::uint32_t f = 0; f < mesh_->all->num_faces(); ++f)
    for (const draco::PointIndex& point : mesh_->all->face(draco::FaceIndex(f))) out.push_back(point.value());
  return out;
}

}  // namespace vsplat::read
