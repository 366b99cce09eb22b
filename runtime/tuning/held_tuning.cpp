#include "runtime/tuning/held_tuning.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/log.h"
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

// The first choice of a table that a self-test has found wrong; empty if there is none.
std::string wrong_in(const std::string& path, const DeviceInfo& device) {
  const std::vector<std::string> refused = refused_choices(device);
  try {
    const TuningTable table = read_tuning(path);
    for (const auto& [shape, values] : table.choice.chosen()) {
      const std::string name = name_of_choice(shape, values);
      if (std::find(refused.begin(), refused.end(), name) != refused.end()) return name;
    }
  } catch (const Error& e) {  // the table's reader reports it
    verbose("{}", e.what());
  }
  return "";
}

// How to run with a table, as text.
std::string way_to(const std::string& hash, const DeviceInfo& device) {
  const std::string go_on = "To continue with the same as before, set VSPLAT_TUNING";
  if (hash.empty()) return go_on + "=off";
  const bool a_hash = hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos;
  const std::string kept = a_hash ? stored_tuning_path(hash) : "";
  std::error_code error;
  if (kept.empty() || !std::filesystem::exists(kept, error)) return go_on + " to that table's file";
  if (const std::string wrong = wrong_in(kept, device); !wrong.empty())
    return fmt::format(
        "That table is refused: a self-test has found a choice of it wrong, {}. Begin again; VSPLAT_SELFTEST=ignore "
        "with VSPLAT_TUNING={} uses it all the same",
        wrong, kept);
  return go_on + "=" + kept;
}

}  // namespace

std::string switched_off_of(const Context& ctx) {
  SwitchedOff off = ctx.switched_off();
  off.tuned = off.mixed = false;
  return in_words(off);
}

void hold_tuning(const Context& ctx, std::map<std::string, std::string>& state) {
  state["tuning"] = ctx.tuning().hash();
  state["precision"] = name_of(ctx.precision());
  state.erase("switched_off");
  if (const std::string off = switched_off_of(ctx); !off.empty()) state["switched_off"] = off;
}

void refuse_other_tuning(const Context& ctx, const std::map<std::string, std::string>& state, const std::string& path) {
  const std::string before = value_of(state, "tuning", ""), now = ctx.tuning().hash();
  if (before != now)
    fail(Status::usage,
         "{}: was begun with {}, but this device runs with {}, which would change the bits of the results. {}", path,
         table_named(before), table_named(now), way_to(before, ctx.device()));
  if (const std::string precision = value_of(state, "precision", "fp32"); precision != name_of(ctx.precision()))
    fail(Status::usage, "{}: was begun in {}, but this device computes in {}: choose {} to continue", path,
         printable(precision), name_of(ctx.precision()), printable(precision));
  if (const std::string off = value_of(state, "switched_off", ""), off_now = switched_off_of(ctx); off != off_now)
    warn("{}: the bits of the results change: a self-test had switched off {} when it was begun, and {} now", path,
         off.empty() ? "nothing" : printable(off), off_now.empty() ? "nothing" : off_now);
}

}  // namespace vsplat
