// Small data sets in temporary folders.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "model/data/object_folder.h"
#include "model/data/solids.h"
#include "model/io/picture/image_file.h"
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

// Removes alpha from the pictures of write_solids() and three rows at top and bottom, like photographs without masks.
inline void take_alpha(const TemporaryFolder& folder, int objects) {
  for (int i = 0; i < objects; ++i) {
    const std::string object = folder / ("solid_" + std::to_string(i));
    nlohmann::json root = read_transforms(object);
    root["h"] = root["h"].get<int>() - 6;
    root["cy"] = root["cy"].get<double>() - 3;
    for (const auto& frame : root["frames"]) {
      const std::string path = object + "/" + frame["file_path"].get<std::string>();
      const Image was = read_image(path);
      Image is(was.width, was.height - 6, 3);
      for (int y = 0; y < is.height; ++y)
        for (int x = 0; x < is.width; ++x)
          for (int c = 0; c < 3; ++c)
            is.at(x, y)[c] = was.at(x, y + 3)[c] * was.at(x, y + 3)[3] + 0.25f * (1 - was.at(x, y + 3)[3]);
      write_png(path, is);
    }
    write_transforms(object, root);
  }
}

}  // namespace vsplat::test
