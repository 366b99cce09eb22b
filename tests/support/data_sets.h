// Small data sets in temporary folders.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "model/data/object_folder.h"
#include "model/data/solids.h"
#include "tests/support/temporary.h"

namespace vsplat::test {

// Folders solid_0, solid_1, ... of random solids.
inline void write_solids(const TemporaryFolder& folder, int count, int views, int size) {
  for (int i = 0; i < count; ++i) {
    ObjectOptions options;
    options.views = views, options.size = size, options.seed = 5, options.object = static_cast<std::uint32_t>(i);
    write_object(folder / ("solid_" + std::to_string(i)), random_solid(9, static_cast<std::uint32_t>(i)), options);
  }
}

inline nlohmann::json read_transforms(const std::string& folder) {
  return nlohmann::json::parse(contents_of(folder + "/transforms.json"));
}
inline void write_transforms(const std::string& folder, const nlohmann::json& json) {
  put_file(folder + "/transforms.json", json.dump());
}

}  // namespace vsplat::test
