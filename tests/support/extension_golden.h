// Vectors of a single part of the model: a file of tests/reference/pytorch/make_extensions.py without "model" in its
// name. Its weights are those of the parameters whose names start with `prefix`.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "model/networks/params/params.h"
#include "model/networks/params/weights.h"
#include "runtime/context.h"
#include "runtime/fail.h"
#include "tests/support/golden.h"

namespace vsplat::test {

class ExtensionGolden {
 public:
  // `bare`: the file's names have no prefix.
  ExtensionGolden(const std::string& name, const std::string& prefix, bool bare = true)
      : file_(Golden::path_of(name)), config_(config_from_json(file_.metadata().at("config"))) {
    for (const Parameter& p : vsplat::parameters(config_)) {
      if (!p.name.starts_with(prefix)) continue;
      parameters_.push_back(p);
      names_[p.name] = bare ? p.name.substr(prefix.size()) : p.name;
      const TensorEntry& entry = file_.at("weight." + names_[p.name]);
      require_shape(p, entry.shape);
      weights_.set(p.name, {entry.shape, file_.floats(entry)});
    }
    std::size_t stored = 0;
    for (const TensorEntry& entry : file_.tensors()) stored += entry.name.starts_with("weight.");
    if (stored != parameters_.size())
      fail(Status::internal, "{}: {} weights, {} expected", file_.path(), stored, parameters_.size());
  }

  const Config& config() const { return config_; }
  const Weights& weights() const { return weights_; }
  const std::vector<Parameter>& parameters() const { return parameters_; }
  // The file's name of each parameter.
  const std::map<std::string, std::string>& names() const { return names_; }

  bool has(const std::string& name) const { return file_.find(name) != nullptr; }
  HostTensor tensor(const std::string& name) const {
    const TensorEntry& entry = file_.at(name);
    return {entry.shape, file_.floats(entry)};
  }
  std::vector<float> floats(const std::string& name) const { return tensor(name).data; }
  Tensor upload(Context& ctx, const std::string& name) const {
    const HostTensor t = tensor(name);
    return ctx.upload(t.shape, t.data, Type::f32, name);
  }

 private:
  SafetensorsFile file_;
  Config config_;
  std::vector<Parameter> parameters_;
  std::map<std::string, std::string> names_;
  Weights weights_;
};

}  // namespace vsplat::test
