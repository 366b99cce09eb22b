#include "runtime/held_tuning.h"

#include <fmt/format.h>

#include <filesystem>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

std::string value_of(const std::map<std::string, std::string>& state, const char* name, const char* otherwise) {
  const auto it = state.find(name);
  return it == state.end() ? otherwise : it->second;
}

std::string table_named(const std::string& hash) {
  return hash.empty() ? "no table of tuned parameters"
                      : "the table of tuned parameters " + printable(hash.substr(0, 12));
}

// What to set to run with a table.
std::string way_to(const std::string& hash) {
  if (hash.empty()) return "set VSPLAT_TUNING=off";
  const bool a_hash = hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos;
  const std::string kept = a_hash ? kept_tuning_path(hash) : "";
  std::error_code error;
  if (!kept.empty() && std::filesystem::exists(kept, error)) return "set VSPLAT_TUNING=" + kept;
  return "set VSPLAT_TUNING to that table's file";
}

}  // namespace

const char* precision_of(const Context&) { return "fp32"; }

void hold_tuning(const Context& ctx, std::map<std::string, std::string>& state) {
  state["tuning"] = ctx.tuning().hash();
  state["precision"] = precision_of(ctx);
}

void refuse_other_tuning(const Context& ctx, const std::map<std::string, std::string>& state, const std::string& path) {
  const std::string before = value_of(state, "tuning", ""), now = ctx.tuning().hash();
  if (before != now)
    fail(Status::usage,
         "{}: was begun with {}, and this device runs with {}: other sums, and other bits. To go on with what it was "
         "begun "
         "with, {}",
         path, table_named(before), table_named(now), way_to(before));
  if (const std::string precision = value_of(state, "precision", "fp32"); precision != precision_of(ctx))
    fail(Status::usage, "{}: was begun in {}, and this device computes in {}: choose {} to go on", path,
         printable(precision), precision_of(ctx), printable(precision));
}

}  // namespace vsplat
