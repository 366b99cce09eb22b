// Messages that transfer a mesh from the reader to the library.
#pragma once
#include <array>

#include "model/io/reader/message.h"

namespace vsplat::read {

// Values as in the file: colours in the file's encoding, clamped to [0,1].
struct MeshCorner {
  std::array<float, 3> position{};
  std::array<float, 3> normal{};            // unit length, or zero if there is none
  std::array<float, 4> colour{1, 1, 1, 1};  // with alpha
  std::array<float, 2> uv{};                // (0,0) is a texture's lower left
  std::array<float, 2> emission_uv{};       // texture coordinates of the emission texture
};
static_assert(sizeof(MeshCorner) == 14 * sizeof(float));

// Attributes shared by the triangles that follow.
struct MeshPart {
  std::string name;
  std::uint32_t material = 0;
  bool has_uv = false;
};

enum class AlphaMode : std::uint32_t { none, mask, blend };
enum class Wrap : std::uint32_t { repeat, clamp, mirror };

struct MeshTexture {
  std::string name;  // name in the file; "" if there is no texture
  Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  bool nearest = false;  // not interpolated
};

struct MeshMaterial {
  MeshTexture texture;
  bool has_factor = false;  // set for glTF
  std::array<float, 4> factor{1, 1, 1, 1};
  bool has_diffuse = false;
  std::array<float, 4> diffuse{1, 1, 1, 1};
  MeshTexture emission_texture;
  std::array<float, 3> emission{};  // linear; may exceed 1
  AlphaMode alpha = AlphaMode::none;
  float cutoff = 0.5f;
};

inline void pack(const MeshPart& part, Packer& out) {
  out.text(part.name).put(part.material).put(std::uint32_t{part.has_uv});
}
inline MeshPart unpack_part(Unpacker& in) {
  MeshPart out;
  out.name = in.text();
  out.material = in.get<std::uint32_t>();
  out.has_uv = in.flag();
  return out;
}

void pack(const MeshMaterial& material, Packer& out);
// BadMessage if a number is not finite.
MeshMaterial unpack_material(Unpacker& in);

}  // namespace vsplat::read
