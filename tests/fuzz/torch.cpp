// PyTorch's checkpoints.
#include <algorithm>
#include <cmath>
#include <variant>

#include "model/io/archive/pickle.h"
#include "model/io/archive/torch_file.h"
#include "model/networks/params/import.h"
#include "model/networks/params/params.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {

void pickle(std::string_view bytes) {
  try {
    const vsplat::pickle::Pickle found =
        vsplat::pickle::read("x.ckpt", {reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()});
    hold(found.root < found.values.size(), "there is a root");
    for (const vsplat::pickle::Value& value : found.values) {
      for (const vsplat::pickle::Ref item : value.items) hold(item < found.values.size(), "items are values");
      hold(value.kind != vsplat::pickle::Kind::dict || value.items.size() % 2 == 0, "every key has a value");
    }
    for (const vsplat::pickle::Tensor& tensor : found.tensors) {
      double last = static_cast<double>(tensor.offset);
      for (std::size_t i = 0; i < tensor.shape.size(); ++i)
        last += static_cast<double>(tensor.shape[i] - 1) * static_cast<double>(tensor.strides.at(i));
      const auto there = static_cast<double>(found.storages.at(tensor.storage).count);
      hold(tensor.count() == 0 || (last >= 0 && last < there * (1 + 1e-9)), "a tensor lies in its storage");
    }
  } catch (const Error& e) {
    hold_message(e, "x.ckpt");
  }
}

void torch_file(std::string_view bytes) {
  static MemoryFile file;
  file.fill(bytes);
  try {
    const TorchFile found(file.path());
    for (const TensorEntry& entry : found.tensors()) {
      hold(&found.at(entry.name) == &entry, "found by its name");
      if (entry.count() > 100'000) continue;  // one element may be repeated many times
      hold(found.floats(entry).size() == static_cast<std::size_t>(entry.count()), "as many values as it says");
    }
    const auto finite = [](const auto& model) {
      for (const Parameter& p : parameters(model.config)) {
        const std::vector<float>& values = model.weights.of(p).data;
        hold(std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); }), "weights are finite");
      }
    };
    std::visit(finite, import_model(file.path()).model);
  } catch (const Error& e) {
    if (e.status() != Status::usage) hold_message(e, file.path());  // fields that shapes do not determine
  }
}

}  // namespace vsplat::fuzz
