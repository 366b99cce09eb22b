// glTF 2.0, as JSON or GLB: what the scene shows in its rest pose.
//
// Honoured: node transforms, skins and morph targets as they stand (no animation), sparse and quantised accessors,
// EXT_meshopt_compression, KHR_draco_mesh_compression, EXT_mesh_gpu_instancing, KHR_node_visibility; of materials the
// base colour, the diffuse part of KHR_materials_pbrSpecularGlossiness, emission, alpha modes, samplers, any texture
// coordinates, KHR_texture_transform, EXT_texture_webp. What says how a surface shines (metal, roughness, normal maps,
// occlusion, clear coat and the like) and the lights are not: the light of a data set is its own. Whatever else is in
// extensionsRequired is refused by its name.
#pragma once
#include "model/io/reader/program/library.h"

namespace vsplat::read {

// As read_mesh(). false, and nothing told: it is glTF 1.0.
bool read_gltf(const std::string& path, Library& library);

}  // namespace vsplat::read
