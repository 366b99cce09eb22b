// Stores each stage's output in a safetensors file, under the golden vectors' names, to compare a port or a driver
// stage by stage.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "runtime/context.h"
#include "runtime/files/safetensors.h"

namespace vsplat {

class Dump {
 public:
  // A ForwardOptions::tap that reads the tensor back and stores it as "stage.<name>".
  std::function<void(const std::string&, const Tensor&)> tap(Context& ctx);

  void add(const std::string& name, Shape shape, std::vector<float> values);
  // Voxel indices as "stage.coords", i64 [P,3].
  void add_coords(const std::vector<int>& selected, int volume);
  // Writes folder/stages.safetensors; creates the folder.
  void write(const std::string& folder, const std::map<std::string, std::string>& metadata) const;

  static std::string path_in(const std::string& folder) { return folder + "/stages.safetensors"; }

 private:
  struct Entry {
    std::string name;
    Shape shape;
    std::vector<float> values;
  };
  std::vector<Entry> entries_;
  std::vector<std::int64_t> coords_;
  bool has_coords_ = false;
};

}  // namespace vsplat
