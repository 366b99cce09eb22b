#include "model/diagnose/tune/check_chosen.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "model/diagnose/tune/search.h"
#include "model/diagnose/tune/tune_case.h"
#include "runtime/files/folder_lock.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// The same kernels with fewer rows, voxels, tokens and keys.
TunedShape little(TunedShape shape) {
  const auto at_most = [&](std::size_t size, long most) { shape.sizes[size] = std::min(shape.sizes[size], most); };
  switch (shape.op) {
    case TunedOp::gemm:
      at_most(0, 517);
      break;
    case TunedOp::gemm_transposed:
      at_most(0, 2100);
      break;
    case TunedOp::conv3d:
    case TunedOp::conv3d_winograd:
    case TunedOp::conv3d_weights:
      at_most(0, 10 * 10 * 10);
      break;
    case TunedOp::attention_forward:
    case TunedOp::attention_backward:
      at_most(0, 2), at_most(1, 165);
      break;
    case TunedOp::radix_sort:
      at_most(0, 70001);
      break;
    case TunedOp::rasterize_forward:
      shape.sizes = {16, 16 * 100};
      break;
    case TunedOp::conv3d_method:
      break;
  }
  return shape;
}

CheckedChoice unchecked(const TunedShape& shape, const TunedValues& values, const std::string& why) {
  return {shape, values, text_of(*values.of, shape) + ", " + text_of(values), INFINITY, why};
}

}  // namespace

bool tells_of_the_device(const Error& error) {
  switch (error.status()) {
    case Status::cancelled:
    case Status::busy:
    case Status::memory:
    case Status::file:
    case Status::usage:
      return false;
    default:
      return true;
  }
}

std::vector<CheckedChoice> unchecked_chosen(const Context& ctx, const std::string& why) {
  std::vector<CheckedChoice> out;
  for (const auto& [shape, values] : ctx.tuning().chosen()) out.push_back(unchecked(shape, values, why));
  return out;
}

std::vector<CheckedChoice> check_chosen(Context& ctx) {
  std::vector<CheckedChoice> out;
  for (const auto& [shape, values] : ctx.tuning().chosen()) {
    CheckedChoice one = unchecked(shape, values, "");
    try {
      one.error = error_of(ctx, little(shape), values);
    } catch (const Error& e) {
      if (!tells_of_the_device(e)) throw;
      one.why = e.what();
    }
    out.push_back(std::move(one));
  }
  return out;
}

int refuse_chosen(const Context& ctx, const std::vector<CheckedChoice>& wrong) {
  const std::string path = tuning_path(tuning_subject(ctx.device(), ctx.flavour()));
  std::error_code error;
  if (path.empty() || !std::filesystem::exists(path, error)) return 0;
  const std::string folder = std::filesystem::path(path).parent_path().string();
  std::optional<FolderLock> lock;
  try {
    lock.emplace(folder, folder + ", where tuned parameters are kept");
    lock->keep_folders();
  } catch (const Error& e) {  // a search is running and would overwrite it
    warn("what is wrong stays in the table, and is not used all the same: {}", e.what());
    return 0;
  }
  TuningTable table = read_tuning(path);
  int out = 0;
  for (const CheckedChoice& one : wrong) {
    const auto it = table.choice.chosen().find(one.shape);
    if (it == table.choice.chosen().end() || !(it->second == one.values)) continue;
    table.choice.set(one.shape, default_values(*one.values.of));
    for (TunedTrial& trial : table.trials)
      if (trial.shape == one.shape && trial.values == one.values) {
        trial.verdict = one.why.empty() ? "wrong" : "failed";
        trial.error = one.why.empty() ? one.error : 0;
        trial.why = one.why;
      }
    ++out;
  }
  if (out > 0) write_tuning(path, table);
  return out;
}

}  // namespace vsplat
