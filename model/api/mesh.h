#pragma once
#include <utility>
#include <variant>

#include "model/api/handle.h"
#include "model/base/surface_mesh.h"
#include "model/data/mesh.h"

struct vsplat_mesh_impl : vsplat::api::Counted {
  explicit vsplat_mesh_impl(vsplat::Mesh from) : mesh(std::move(from)) {}
  explicit vsplat_mesh_impl(vsplat::SurfaceMesh from) : mesh(std::move(from)) {}
  const std::variant<vsplat::Mesh, vsplat::SurfaceMesh> mesh;
};
