#include "session.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "arguments.h"
#include "runtime/files/cache_folders.h"
#include "runtime/system/system.h"

namespace command {
namespace {

// The devices of --device: "all", or a comma-separated list if all parts are indices or platform:device; else the
// single device that it names.
std::vector<std::string> named_devices(const std::string& text) {
  std::vector<std::string> out;
  if (text == "all") {
    for (const vsplat_device_info& device : vsplat::Device::list()) out.push_back(std::to_string(device.index));
    return out.empty() ? std::vector<std::string>{""} : out;  // opening it reports what is missing
  }
  const bool indices = text.find(',') != std::string::npos &&
                       std::all_of(text.begin(), text.end(),
                                   [](unsigned char c) { return std::isdigit(c) || c == ',' || c == ':' || c == ' '; });
  return indices ? list("--device", text) : std::vector<std::string>{text};
}

}  // namespace

vsplat_device_options Session::options(const std::string& device) {
  vsplat_device_options out = VSPLAT_DEVICE_OPTIONS_INIT;
  out.device = device.c_str();
  out.kernels = common_.kernels == "cpu"   ? VSPLAT_KERNELS_CPU
                : common_.kernels == "gpu" ? VSPLAT_KERNELS_GPU
                                           : VSPLAT_KERNELS_AUTO;
  out.gemm = common_.gemm == "own"       ? VSPLAT_GEMM_OWN
             : common_.gemm == "clblast" ? VSPLAT_GEMM_CLBLAST
                                         : VSPLAT_GEMM_AUTO;
  out.max_memory_gib = common_.max_memory;
  out.precision = common_.precision == "mixed"  ? VSPLAT_PRECISION_MIXED
                  : common_.precision == "auto" ? VSPLAT_PRECISION_AUTO
                                                : VSPLAT_PRECISION_FP32;
  out.on_compile = on_compile;
  out.user = this;
  return out;
}

Session::Session(const Common& common, Devices most) : common_(common) {
  const std::vector<std::string> named = named_devices(common.device);
  if (named.size() > 1 && most == Devices::one)
    throw UsageError("--device " + common.device + " is " + std::to_string(named.size()) +
                     " devices, but this command takes one: render, evaluate, train and reconstruct --list share work "
                     "among several");
  const bool timed = wants_times(common_);
  if (named.size() > 1 && timed)
    throw UsageError("--profile and --trace need one device: --device " + common.device + " is " +
                     std::to_string(named.size()));
  for (const std::string& name : named) {
    devices_.emplace_back(options(name));
    const vsplat_device_info info = devices_.back().info();
    if (info.platform_name == std::string("Portable Computing Language"))
      vsplat::sys::tell_of_faults(
          "vsplat: crashed by a fault in PoCL or in vsplat. PoCL's compiled kernels may be damaged: `rm -r " +
          vsplat::pocl_cache().path + "` clears them, and they are compiled again\n");
    for (std::size_t i = 0; i + 1 < devices_.size(); ++i)
      if (devices_[i].info().index == info.index)
        throw UsageError("--device " + common.device + " names device " + std::to_string(info.index) + " twice");
    say(common_, std::string("device ") + std::to_string(info.index) + ": " + info.name + " (" + info.platform_name +
                     "), driver " + info.driver + ", " + (info.kernels == VSPLAT_KERNELS_GPU ? "gpu" : "cpu") +
                     " kernels" +
                     (*info.matrix_unit ? ", mixed precision (" + std::string(info.matrix_unit) + ")" : "") +
                     (*info.tuning ? ", tuned (table " + std::string(info.tuning, 12) + ")" : "") +
                     (info.event_profiling ? "" : ", timed on the host") +
                     (*info.limits ? std::string(", lowered by VSPLAT_LIMITS=") + info.limits : "") +
                     (*info.switched_off ? std::string(", not used since its self-test: ") + info.switched_off : ""));
  }
  for (const vsplat::Device& device : devices_) {
    handles_.push_back(device.get());
    if (device.info().matrix_unit == std::string("emulated"))
      say(common_,
          "mixed precision: device " + std::to_string(device.info().index) +
              " has no matrix units that have passed their test; they are emulated, which is slower than fp32");
  }
  if (common_.precision == "auto")
    for (const vsplat::Device& device : devices_)
      if (!*device.info().matrix_unit)
        say(common_, "device " + std::to_string(device.info().index) +
                         " computes in fp32: its kernels have no matrix units, or no self-test has found mixed "
                         "precision as good "
                         "(vsplat selftest)");
  recorded_ = timed || (common_.verbose && devices_.size() == 1);
  if (recorded_) devices_.front().profile(true);
}

void Session::on_compile(void* session, const char* kernel, int32_t compiled) {
  auto* self = static_cast<Session*>(session);
  const std::lock_guard lock(self->mutex_);
  if (!vsplat::sys::error_output_is_terminal() && !self->compiled_)
    say(self->common_, "preparing kernels; a device's first run takes longest");
  self->compiled_ = true;
  show_progress(self->common_, "preparing kernels: " + std::to_string(compiled + 1) + " (" + kernel + ")");
}

void Session::start(const std::string& what) {
  what_ = what;
  started_ = last_line_ = elapsed_seconds();
  stage_.clear();
}

int32_t Session::on_progress(void* session, const char* stage, double done) {
  auto* self = static_cast<Session*>(session);
  if (interrupted()) return 0;
  const std::lock_guard lock(self->mutex_);
  const double now = elapsed_seconds(), spent = now - self->started_;
  std::string text =
      self->what_ + ": " + stage + ", " + std::to_string(static_cast<int>(100 * done)) + " %, " + seconds_text(spent);
  if (done > 0.05 && done < 1) text += ", about " + seconds_text(spent * (1 - done) / done) + " left";
  if (vsplat::sys::error_output_is_terminal()) {
    show_progress(self->common_, text);
  } else if (self->stage_ != stage && (self->common_.verbose || now - self->last_line_ > 5)) {  // few lines in a log
    self->last_line_ = now;
    say(self->common_, text);
  }
  self->stage_ = stage;
  return 1;
}

void Session::add_numerics(nlohmann::ordered_json& out) const {
  using Json = nlohmann::ordered_json;
  const auto of_all = [&](const auto& text_of) {
    Json all = Json::array();
    bool alike = true;
    for (const vsplat::Device& device : devices_) {
      const std::string text = text_of(device.info());
      all.push_back(text.empty() ? Json() : Json(text));
      alike = alike && all.back() == all.front();
    }
    return alike ? all.front() : all;
  };
  out["tuning"] = of_all([](const vsplat_device_info& info) { return info.tuning; });
  out["precision"] = of_all([](const vsplat_device_info& info) { return *info.matrix_unit ? "mixed" : "fp32"; });
  out["switched_off"] = of_all([](const vsplat_device_info& info) { return info.switched_off; });
  if (common_.precision != "fp32")
    out["matrix_unit"] = of_all([](const vsplat_device_info& info) { return info.matrix_unit; });
}

void Session::write_profile(Outputs& outputs) {
  if (!recorded_) return;
  devices_.front().profile(false);
  const bool page = common_.profile.ends_with(".html");
  if (!common_.profile.empty())
    write_text(outputs.begin(common_.profile), device().profile_text(page ? VSPLAT_PROFILE_PAGE : VSPLAT_PROFILE_JSON));
  if (!common_.trace.empty()) write_text(outputs.begin(common_.trace), device().profile_text(VSPLAT_PROFILE_TRACE));
  if (common_.verbose) say(common_, device().profile_text(VSPLAT_PROFILE_TABLE));
}

vsplat::Model load_model(const std::string& path) {
  return path.empty() ? vsplat::Model::load() : vsplat::Model::load(path);
}

std::string model_name(const std::string& path) { return path.empty() ? "built-in" : path; }

void add_host_memory(vsplat_plan& plan, uint64_t bytes, const vsplat::Device& device) {
  plan.host_peak += bytes;
  const uint64_t shared = device.info().type == VSPLAT_DEVICE_CPU ? plan.peak : 0;
  plan.fits = plan.fits && plan.host_peak + shared <= plan.host_limit;
}

void print_plans(const Common& common, const std::vector<Plan>& plans) {
  if (common.json) {
    nlohmann::ordered_json out = nlohmann::ordered_json::array();
    for (const Plan& p : plans) {
      nlohmann::ordered_json stages = nlohmann::ordered_json::array();
      for (uint32_t i = 0; i < p.plan.num_stages; ++i)
        stages.push_back({{"stage", p.plan.stages[i].stage},
                          {"reserved", p.plan.stages[i].reserved},
                          {"live", p.plan.stages[i].live}});
      out.push_back({{"what", p.title},
                     {"peak_bytes", p.plan.peak},
                     {"limit_bytes", p.plan.limit},
                     {"host_peak_bytes", p.plan.host_peak},
                     {"host_limit_bytes", p.plan.host_limit},
                     {"fits", p.plan.fits != 0},
                     {"stages", stages}});
      if (p.time && p.time->steps > 0) out.back()["steps"] = p.time->steps;
      if (p.time) out.back()["seconds"] = p.time->seconds;
    }
    print_json(out);
    return;
  }
  for (const Plan& p : plans) {
    std::printf("%s\n", for_terminal(p.title).c_str());
    for (uint32_t i = 0; i < p.plan.num_stages; ++i)
      std::printf("  %-12s %10s held, %10s in use\n", p.plan.stages[i].stage,
                  bytes_text(p.plan.stages[i].reserved).c_str(), bytes_text(p.plan.stages[i].live).c_str());
    std::printf("  %-12s %10s of %s\n", "peak", bytes_text(p.plan.peak).c_str(), bytes_text(p.plan.limit).c_str());
    std::printf("  %-12s %10s of %s: %s\n", "host", bytes_text(p.plan.host_peak).c_str(),
                bytes_text(p.plan.host_limit).c_str(), p.plan.fits ? "fits" : "DOES NOT FIT");
    if (p.time)
      std::printf("  %-12s about %s%s\n", "time", seconds_text(p.time->seconds).c_str(),
                  p.time->steps > 0 ? (" for " + std::to_string(p.time->steps) + " steps").c_str() : "");
  }
}

}  // namespace command
