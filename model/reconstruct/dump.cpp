#include "model/reconstruct/dump.h"

#include <filesystem>

#include "runtime/fail.h"

namespace vsplat {

std::function<void(const std::string&, const Tensor&)> Dump::tap(Context& ctx) {
  return
      [this, &ctx](const std::string& name, const Tensor& t) { add("stage." + name, t.shape(), ctx.read<float>(t)); };
}

void Dump::add(const std::string& name, Shape shape, std::vector<float> values) {
  entries_.push_back({name, std::move(shape), std::move(values)});
}

void Dump::add_coords(const std::vector<int>& selected, int volume) {
  has_coords_ = true;
  for (const int index : selected)
    for (const int c : {index / (volume * volume), index / volume % volume, index % volume}) coords_.push_back(c);
}

void Dump::write(const std::string& folder, const std::map<std::string, std::string>& metadata) const {
  std::vector<TensorToWrite> tensors;
  for (const Entry& e : entries_) tensors.push_back({e.name, Dtype::f32, e.shape, e.values.data()});
  if (has_coords_)
    tensors.push_back({"stage.coords", Dtype::i64, {static_cast<long>(coords_.size() / 3), 3}, coords_.data()});
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) fail(Status::file, "{}: the folder cannot be made: {}", folder, failed.message());
  write_safetensors(path_in(folder), tensors, metadata);
}

}  // namespace vsplat
