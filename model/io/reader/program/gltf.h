// Reads glTF 2.0, as JSON or GLB: the scene in its rest pose.
//
// Supported: node transforms, skins and morph targets at their stored values (no animation), sparse and quantised
// accessors, EXT_meshopt_compression, KHR_draco_mesh_compression, EXT_mesh_gpu_instancing, KHR_node_visibility. Of
// materials: base colour, the diffuse part of KHR_materials_pbrSpecularGlossiness, emission, alpha modes, samplers, any
// texture coordinates, KHR_texture_transform, EXT_texture_webp. Ignored: reflection properties (metal, roughness,
// normal maps, occlusion, clear coat and the like) and lights, because a data set has its own lighting. Any other name
// in extensionsRequired is refused.
#pragma once
#include "model/io/reader/program/library.h"

namespace vsplat::read {

// As read_mesh(). Returns false, with nothing sent, if the file is glTF 1.0.
bool read_gltf(const std::string& path, Library& library);

}  // namespace vsplat::read
