#include "runtime/profile/energy.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>

#include "runtime/clock.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kBetweenSamples = 5'000'000'000;  // ns; a package's counter lasts for minutes

std::optional<double> number_in(const fs::path& path) {
  std::ifstream file(path);
  double out = 0;
  if (!(file >> out) || !(out >= 0)) return std::nullopt;
  return out;
}

// The NVML functions in use, by its stable interface; the library is loaded once.
class Nvml {
 public:
  using Handle = void*;

  static const Nvml* loaded() {
    static const std::unique_ptr<const Nvml> library = [] {
      std::unique_ptr<const Nvml> out(new Nvml);
      return out->usable_ ? std::move(out) : nullptr;
    }();
    return library.get();
  }

  std::optional<Handle> at(const std::string& pci) const {
    Handle out = nullptr;
    if (find_(pci.c_str(), &out) != 0) return std::nullopt;
    return out;
  }
  std::optional<double> joules(Handle device) const {
    unsigned long long millijoules = 0;
    if (energy_(device, &millijoules) != 0) return std::nullopt;
    return static_cast<double>(millijoules) * 1e-3;
  }

 private:
  Nvml() {
    std::string why;
    void* library = sys::load_library("libnvidia-ml.so.1", sys::Symbols::own, why);
    if (!library) return;
    const auto init = reinterpret_cast<int (*)()>(sys::symbol(library, "nvmlInit_v2"));
    find_ = reinterpret_cast<decltype(find_)>(sys::symbol(library, "nvmlDeviceGetHandleByPciBusId_v2"));
    energy_ = reinterpret_cast<decltype(energy_)>(sys::symbol(library, "nvmlDeviceGetTotalEnergyConsumption"));
    usable_ = init && find_ && energy_ && init() == 0;
  }

  int (*find_)(const char*, Handle*) = nullptr;
  int (*energy_)(Handle, unsigned long long*) = nullptr;
  bool usable_ = false;
};

}  // namespace

std::vector<EnergySource> rapl_sources(const std::string& folder) {
  std::vector<fs::path> packages;
  std::error_code problem;
  for (fs::directory_iterator at(folder, problem), end; !problem && at != end; at.increment(problem)) {
    const std::string name = at->path().filename().string();
    if (name.rfind("intel-rapl:", 0) == 0 && std::count(name.begin(), name.end(), ':') == 1)
      packages.push_back(at->path());
  }
  std::sort(packages.begin(), packages.end());
  std::vector<EnergySource> out;
  for (const fs::path& package : packages) {
    std::string name;
    std::ifstream(package / "name") >> name;
    const auto range = number_in(package / "max_energy_range_uj");
    if (name.rfind("package", 0) != 0 || !range || !number_in(package / "energy_uj")) continue;
    out.push_back({name + " (RAPL)", *range * 1e-6, [path = package / "energy_uj"]() -> std::optional<double> {
                     const auto microjoules = number_in(path);
                     if (!microjoules) return std::nullopt;
                     return *microjoules * 1e-6;
                   }});
  }
  return out;
}

std::vector<EnergySource> nvml_sources(const std::string& pci) {
  const Nvml* nvml = pci.empty() ? nullptr : Nvml::loaded();
  if (!nvml) return {};
  const auto device = nvml->at(pci);
  if (!device || !nvml->joules(*device)) return {};
  return {{"GPU " + pci + " (NVML)", 0, [nvml, device] { return nvml->joules(*device); }}};
}

void EnergyMeter::add() {
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    State& state = state_[i];
    const std::optional<double> now = sources_[i].counter();
    if (now && state.last) {
      const double more = *now - *state.last;
      if (more >= 0 || sources_[i].range > 0) {
        state.joules += more >= 0 ? more : more + sources_[i].range;
        state.read = true;
      }
    }
    if (now) state.last = now;
  }
  sampled_ns_ = now_ns();
}

void EnergyMeter::start() {
  for (State& state : state_) state.last.reset();
  add();
  running_ = true;
}

void EnergyMeter::sample() {
  if (running_ && now_ns() - sampled_ns_ >= kBetweenSamples) add();
}

void EnergyMeter::sample_now() {
  if (running_) add();
}

void EnergyMeter::stop() {
  sample_now();
  running_ = false;
}

std::vector<Energy> EnergyMeter::taken() const {
  std::vector<Energy> out;
  for (std::size_t i = 0; i < sources_.size(); ++i)
    if (state_[i].read) out.push_back({sources_[i].name, state_[i].joules});
  return out;
}

}  // namespace vsplat
