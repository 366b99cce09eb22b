#include "bench/pytorch.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "bench/references.h"
#include "runtime/log.h"
#include "runtime/system/system_process.h"

namespace vsplat::bench {
namespace {

constexpr double kLongest = 1800;  // seconds; the published size takes minutes on two cores
constexpr std::size_t kMostSaid = 10000;

// The last line of what the script writes, or why there is none.
nlohmann::json result_of(const std::string& size, int threads, double seconds, std::string& why) {
  const std::string script = beside_bench("pytorch_forward.py");
  std::error_code none;
  if (!std::filesystem::exists(script, none)) {
    why = "this program is not where it was built";
    return {};
  }
  std::error_code no_pipe, not_started;
  const sys::WatchedEnd end =
      sys::watch_program("/usr/bin/env", {"python3", script, size, std::to_string(threads), std::to_string(seconds)},
                         {.most_said = kMostSaid, .seconds = kLongest}, no_pipe, not_started);
  if (no_pipe || not_started) {
    why = (no_pipe ? no_pipe : not_started).message();
    return {};
  }
  std::string said = end.said;
  while (!said.empty() && said.back() == '\n') said.pop_back();
  const std::string line = said.substr(said.rfind('\n') + 1);
  why = end.too_late ? fmt::format("it took longer than {} s", kLongest) : line;
  return end.exit_code == 0 ? nlohmann::json::parse(line, nullptr, false) : nlohmann::json();
}

}  // namespace

std::map<std::string, double> pytorch_seconds(const Context& ctx, const std::string& size, double seconds) {
  std::string why = "the device is not a processor";
  nlohmann::json result;
  if (ctx.device().type == DeviceType::cpu) result = result_of(size, ctx.device().compute_units, seconds, why);
  std::map<std::string, double> out;
  if (!result.is_object()) {
    info("model/{}: without PyTorch: {}", size, why);
    return out;
  }
  for (const char* precision : {"fp32", "bf16"})
    out[fmt::format("PyTorch {} {}", result["version"].get<std::string>(), precision)] =
        result[precision].get<double>();
  return out;
}

}  // namespace vsplat::bench
