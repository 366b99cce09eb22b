// Files of tensors.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include "model/fit/fit_checkpoint.h"
#include "model/networks/params/model_file.h"
#include "model/networks/params/params.h"
#include "model/train/checkpoint.h"
#include "runtime/files/sha256.h"
#include "tests/fuzz/targets.h"
#include "tests/support/temporary.h"

namespace vsplat::fuzz {
namespace {

// The bytes with their own hash corrected, if they state one.
std::string with_right_hash(std::string_view bytes) {
  constexpr std::string_view kKey = "\"sha256\":\"";
  constexpr std::size_t kDigits = 64;
  std::string out(bytes);
  const std::size_t at = out.find(kKey);
  if (at == std::string::npos || out.size() - at - kKey.size() < kDigits) return out;
  out.replace(at + kKey.size(), kDigits, kDigits, '0');
  Sha256 sha;
  sha.add(out.data(), out.size());
  return out.replace(at + kKey.size(), kDigits, sha.hex());
}

void check(const Weights& weights, const AnyConfig& config) {
  for (const Parameter& p : parameters(config)) {
    const std::vector<float>& values = weights.of(p).data;
    hold(static_cast<long>(values.size()) == p.count(), "as many values as the configuration says");
    hold(std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); }), "weights are finite");
  }
}

// Reads the file at `path`.
template <class Read>
void read_twice(MemoryFile& file, const std::string& path, std::string_view bytes, Read read) {
  const std::string right = with_right_hash(bytes);
  for (const std::string_view content : {bytes, std::string_view(right)}) {
    if (content.data() == right.data() && content == bytes) continue;
    file.fill(content);
    try {
      read();
    } catch (const Error& e) {
      hold_message(e, path);
    }
  }
}

}  // namespace

void model(std::string_view bytes) {
  static MemoryFile file;
  read_twice(file, file.path(), bytes, [&] {
    bool good = true;
    try {
      verify_model(file.path());
      model_info(file.path());
    } catch (const Error& e) {
      hold_message(e, file.path());
      good = false;
    }
    const ModelFile found = load_model(file.path());
    hold(good, "what is verified and what is loaded are the same");
    check(found.weights, found.config);
  });
}

void checkpoint(std::string_view bytes) {
  static MemoryFile file;
  read_twice(file, file.path(), bytes, [&] {
    const Checkpoint found = load_checkpoint(file.path());
    hold(found.step >= 0, "steps done");
    check(found.parameters, found.config.model);
    if (found.config.ema != 0) check(found.average, found.config.model);
    for (const auto& [name, tensor] : found.m.all()) hold(found.v.has(name), "moments come in pairs");
  });
}

void fit_checkpoint(std::string_view bytes) {
  static test::TemporaryFolder folder;
  static MemoryFile file;
  const std::string path = fit_checkpoint_path(folder.path());
  if (!std::filesystem::exists(path)) std::filesystem::create_symlink(file.path(), path);
  read_twice(file, path, bytes, [&] {
    std::optional<FitCheckpoint> found;
    try {
      found = load_fit_checkpoint(folder.path(), "fuzz");
    } catch (const Error& e) {
      if (e.status() == Status::usage) return;  // the state of another fit
      throw;
    }
    hold(found.has_value(), "the file is there");
    for (const auto& [name, tensor] : found->tensors) {
      std::size_t count = 1;
      for (const long side : tensor.shape) count *= static_cast<std::size_t>(side);
      hold(tensor.data.size() == count && &tensor_of(found->tensors, name) == &tensor, "as many values as it says");
    }
    for (const auto& [name, text] : found->state) {
      try {
        number(*found, name);
        hold(whole_number(*found, name) >= 0, "a whole number from 0");
      } catch (const Error& e) {
        hold_message(e, "state");
      }
    }
  });
}

}  // namespace vsplat::fuzz
